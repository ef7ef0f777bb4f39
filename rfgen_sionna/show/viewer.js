"use strict";
const by = id => document.getElementById(id);
const page = JSON.parse(by("header").textContent);
const INK = "#1d2733", MUTED = "#6b7785", LINE = "#d4dae0", ACCENT = "#19c3d6";
const TINTS = [[184, 194, 207], [214, 190, 160], [170, 200, 175], [205, 178, 200]];
const HOME = { turn: 0, lift: 0.35, zoom: 1, right: 0, up: 0 };
const eye = { ...HOME };
let arrays, panels = [], now = 0, playing = false, clock = 0;

async function unpack() {
  const packed = Uint8Array.from(atob(by("arrays").textContent), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = await new Response(stream).arrayBuffer();
  const kinds = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };
  return Object.fromEntries(Object.entries(page.arrays).map(([name, { dtype, shape, offset }]) => {
    const size = shape.reduce((a, b) => a * b, 1);
    return [name, { shape, size, values: new kinds[dtype](bytes, offset, size) }];
  }));
}

function pen(canvas) {                          // context in CSS pixels, sharp on any screen
  const scale = devicePixelRatio || 1, wide = canvas.clientWidth, high = canvas.clientHeight;
  canvas.width = wide * scale; canvas.height = high * scale;
  const g = canvas.getContext("2d");
  g.scale(scale, scale); g.font = "11px system-ui, sans-serif";
  return { g, wide, high };
}

function ticks(low, high, most) {
  const rough = Math.abs(high - low) / most, ten = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map(k => k * ten).find(k => k >= rough), found = [];
  for (let k = Math.ceil(Math.min(low, high) / step); k * step <= Math.max(low, high); k++) found.push(k * step);
  return found;
}
const text = value => String(+value.toPrecision(6)).replace("-", "−");
const colour = (map, level) => page.colours[map].slice(3 * level, 3 * level + 3);

function panel(place, plot) {                   // one picture with axes and a colour bar
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  const title = document.createElement("b"), note = document.createElement("span");
  const canvas = document.createElement("canvas"), image = document.createElement("canvas");
  title.textContent = plot.title + " "; note.textContent = plot.note || "";
  canvas.setAttribute("aria-label", plot.title);
  caption.append(title, note); figure.append(caption, canvas); by(place).append(figure);
  const { shape, values } = arrays[plot.array], [, rows, columns] = shape;
  image.width = columns; image.height = rows;
  const ink = image.getContext("2d"), pixels = ink.createImageData(columns, rows), table = page.colours[plot.map];
  let filled = -1;
  const fill = frame => {
    if (filled === frame) return;
    const start = (filled = frame) * rows * columns;
    for (let k = 0; k < rows * columns; k++) {
      const level = values[start + k];
      for (let c = 0; c < 3; c++) pixels.data[4 * k + c] = level < 255 ? table[3 * level + c] : 217 + 5 * c;
      pixels.data[4 * k + 3] = 255;
    }
    ink.putImageData(pixels, 0, 0);
  };
  const seek = event => {
    const { left, wide } = canvas.area, x = (event.offsetX - left) / wide;
    const time = plot.x[0] + x * (plot.x[1] - plot.x[0]);
    let best = 0;
    page.times.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(page.times[best] - time)) best = k; });
    show(best);
  };
  if (plot.xLabel === "time [s]") {
    canvas.style.cursor = "pointer";
    canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId); seek(event); };
    canvas.onpointermove = event => { if (event.buttons) seek(event); };
  }
  return () => {
    fill(shape[0] > 1 ? now : 0);
    const { g, wide, high } = pen(canvas);
    let left = 46, right = wide - 62, top = 6, bottom = high - 34;
    if (plot.square) {                          // as wide as high, by the angles
      const ratio = Math.abs((plot.x[1] - plot.x[0]) / (plot.y[1] - plot.y[0]));
      const size = Math.min((right - left) / ratio, bottom - top);
      left += (right - left - size * ratio) / 2; right = left + size * ratio;
      top += (bottom - top - size) / 2; bottom = top + size;
    }
    canvas.area = { left, wide: right - left };
    const toX = x => left + (x - plot.x[0]) / (plot.x[1] - plot.x[0]) * (right - left);
    const toY = y => bottom - (y - plot.y[0]) / (plot.y[1] - plot.y[0]) * (bottom - top);
    g.imageSmoothingEnabled = false;
    g.drawImage(image, left, top, right - left, bottom - top);
    g.strokeStyle = MUTED; g.lineWidth = 0.7; g.strokeRect(left, top, right - left, bottom - top);
    g.fillStyle = INK; g.textAlign = "center";
    const degrees = plot.tangent ? d => Math.tan(d * Math.PI / 180) : d => d;
    const back = plot.tangent ? x => Math.atan(x) * 180 / Math.PI : x => x;
    for (const x of ticks(back(plot.x[0]), back(plot.x[1]), (right - left) / (plot.square ? 28 : 55))) {
      g.fillRect(toX(degrees(x)), bottom, 0.7, 3); g.fillText(text(x), toX(degrees(x)), bottom + 14);
    }
    g.fillText(plot.xLabel, (left + right) / 2, bottom + 29);
    g.textAlign = "right"; g.textBaseline = "middle";
    for (const y of ticks(back(plot.y[0]), back(plot.y[1]), (bottom - top) / 30)) {
      g.fillRect(left - 3, toY(degrees(y)), 3, 0.7); g.fillText(text(y), left - 6, toY(degrees(y)));
    }
    g.save(); g.translate(left - 36, (top + bottom) / 2); g.rotate(-Math.PI / 2); g.textAlign = "center";
    g.fillText(plot.yLabel, 0, 0); g.restore();
    const bar = right + 8, [low, peak] = plot.limits;
    for (let k = 0; k < 255; k++) {
      g.fillStyle = `rgb(${colour(plot.map, 254 - k)})`;
      g.fillRect(bar, top + k * (bottom - top) / 255, 9, (bottom - top) / 255 + 0.6);
    }
    g.fillStyle = INK; g.textAlign = "left";
    for (const v of ticks(low, peak, (bottom - top) / 30))
      g.fillText(text(v), bar + 13, bottom - (v - low) / (peak - low) * (bottom - top));
    g.fillStyle = MUTED; g.fillText(plot.unit, bar, bottom + 14);
    g.save(); g.beginPath(); g.rect(left, top, right - left, bottom - top); g.clip();
    if (plot.line) {
      g.strokeStyle = ACCENT; g.setLineDash([5, 3]); g.lineWidth = 1.2;
      for (const values of plot.line.values) {
        g.beginPath();
        let on = false;
        values.forEach((v, k) => {
          if (v === null) { on = false; return; }
          g[on ? "lineTo" : "moveTo"](toX(plot.line.times[k]), toY(v)); on = true;
        });
        g.stroke();
      }
      g.setLineDash([]); g.fillStyle = ACCENT; g.textAlign = "right";
      g.fillText(plot.line.name, right - 6, top + 10);
    }
    if (plot.xLabel === "time [s]") {
      g.strokeStyle = "white"; g.lineWidth = 1.4; g.beginPath();
      g.moveTo(toX(page.times[now]), top); g.lineTo(toX(page.times[now]), bottom); g.stroke();
    }
    g.restore();
  };
}

function floor() {                              // step [m] of the grid, and its ends
  const step = Math.max(page.high[0] - page.low[0], page.high[1] - page.low[1]) > 12 ? 5 : 1;
  const ends = [0, 1].flatMap(i => [Math.floor(page.low[i] / step) * step, Math.ceil(page.high[i] / step) * step]);
  return { step, ends };
}

function project(turn, lift) {                  // world [m] to right, down and near [m]; from behind the radar at first
  const yaw = Math.atan2(page.boresight[1], page.boresight[0]) + Math.PI + 0.6 + turn;
  const [c, s, k, l] = [Math.cos(yaw), Math.sin(yaw), Math.cos(lift), Math.sin(lift)];
  const middle = page.low.map((x, i) => (x + page.high[i]) / 2);
  const away = 2.6 * Math.hypot(...page.high.map((x, i) => x - page.low[i]));
  return ([x, y, z]) => {
    x -= middle[0]; y -= middle[1]; z -= middle[2];
    const near = (c * x + s * y) * k + z * l, scale = away / (away - near);
    return [scale * (c * y - s * x), scale * ((c * x + s * y) * l - z * k), near];
  };
}

function camera(wide, high) {                   // to pixels; the box of the scene fills the picture at first
  const [x0, x1, y0, y1] = floor().ends, [x2, y2, z2] = page.low, [x3, y3, z3] = page.high;
  const box = [[x0, y0, z2], [x0, y1, z2], [x1, y0, z2], [x1, y1, z2], [x2, y2, z3], [x2, y3, z3], [x3, y2, z3], [x3, y3, z3]];
  const home = box.map(project(HOME.turn, HOME.lift));
  const [l, r, t, b] = [0, 1].flatMap(i => [Math.min, Math.max].map(end => end(...home.map(p => p[i]))));
  const unit = Math.min((wide - 40) / (r - l), (high - 60) / (b - t)) * eye.zoom, seen = project(eye.turn, eye.lift);
  return Object.assign(place => {
    const [x, y, near] = seen(place);
    return [wide / 2 + eye.right + unit * (x - (l + r) / 2), high / 2 - 8 + eye.up + unit * (y - (t + b) / 2), near];
  }, { unit });
}

function points(name) {                         // positions of the frame [m]
  const { shape, values } = arrays[name], count = shape[1], start = 3 * count * now, found = [];
  for (let k = 0; k < count; k++) found.push([0, 1, 2].map(i =>
    page.low[i] + values[start + 3 * k + i] / 65535 * (page.high[i] - page.low[i])));
  return found;
}

function drawScene() {
  const { g, wide, high } = pen(by("scene")), see = camera(wide, high), { low } = page;
  const line = (a, b, ink, width = 1) => {
    const [p, q] = [see(a), see(b)];
    g.strokeStyle = ink; g.lineWidth = width; g.beginPath(); g.moveTo(p[0], p[1]); g.lineTo(q[0], q[1]); g.stroke();
  };
  const write = (place, words, ink = MUTED) => {
    const [x, y] = see(place);
    g.fillStyle = ink; g.textAlign = "center"; g.fillText(words, x, y);
  };
  const { step, ends: [x0, x1, y0, y1] } = floor();
  for (let x = x0; x <= x1; x += step) line([x, y0, low[2]], [x, y1, low[2]], LINE);
  for (let y = y0; y <= y1; y += step) line([x0, y, low[2]], [x1, y, low[2]], LINE);
  "xyz".split("").forEach((name, i) => {        // world axes at a corner of the floor
    const corner = [x0, y0, low[2]], end = [...corner];
    end[i] += 0.5 * step; line(corner, end, ["#d04040", "#2f9e44", "#3060d0"][i], 2);
    end[i] += 0.15 * step; write(end, name, INK);
  });
  const drawn = [];
  if (by("showMesh").checked) page.actors.forEach((actor, number) => {
    const seen = points(`${actor.array}.mesh`).map(see), { values } = arrays[`${actor.array}.faces`];
    const tint = TINTS[number % TINTS.length];
    for (let k = 0; k < values.length; k += 3) {
      const [a, b, c] = [seen[values[k]], seen[values[k + 1]], seen[values[k + 2]]];
      const u = [b[0] - a[0], b[1] - a[1]], v = [c[0] - a[0], c[1] - a[1]];
      const facing = u[1] * v[0] - u[0] * v[1];
      if (facing <= 0) continue;                // turned away
      const dz1 = (b[2] - a[2]) * see.unit, dz2 = (c[2] - a[2]) * see.unit;
      const n = [-u[1] * dz2 + dz1 * v[1], u[0] * dz2 - dz1 * v[0], facing], size = Math.hypot(...n);
      const light = Math.max(0, (0.35 * n[0] + 0.55 * n[1] + 0.75 * n[2]) / size);
      drawn.push({ near: a[2] + b[2] + c[2], corners: [a, b, c], ink: `rgb(${tint.map(t => Math.round(t * (0.45 + 0.6 * light)))})` });
    }
  });
  drawn.sort((a, b) => a.near - b.near);
  g.lineWidth = 0.6; g.lineJoin = "round";
  for (const { corners: [a, b, c], ink } of drawn) {
    g.fillStyle = g.strokeStyle = ink; g.beginPath();
    g.moveTo(a[0], a[1]); g.lineTo(b[0], b[1]); g.lineTo(c[0], c[1]); g.closePath(); g.fill(); g.stroke();
  }
  page.actors.forEach(actor => {
    const joints = points(`${actor.array}.joints`), { values } = arrays[`${actor.array}.bones`];
    if (joints.length && (by("showJoints").checked || !arrays[`${actor.array}.faces`].size)) {
      for (let k = 0; k < values.length; k += 2) line(joints[values[k]], joints[values[k + 1]], "#7a4fb5", 1.8);
      for (const joint of joints) { const [x, y] = see(joint); g.fillStyle = INK; g.fillRect(x - 1.5, y - 1.5, 3, 3); }
    }
    const all = points(`${actor.array}.mesh`).concat(joints);
    if (all.length) {
      const mean = [0, 1].map(i => all.reduce((sum, p) => sum + p[i], 0) / all.length);
      write([...mean, all.reduce((most, p) => Math.max(most, p[2]), -1e9) + 0.12], actor.name);
    }
  });
  const ahead = page.place.map((x, i) => x + 0.5 * page.boresight[i]);
  line(page.place, ahead, ACCENT, 2.5);
  const [px, py] = see(page.place);
  g.fillStyle = INK; g.fillRect(px - 5, py - 5, 10, 10);
  write(page.place.map((x, i) => x + (i === 2 ? 0.15 : 0)), page.radarName, INK);
  const first = page.cloud.starts[now], last = page.cloud.starts[now + 1], speed = page.cloud.speed;
  if (by("showCloud").checked) for (let k = first; k < last; k++) {
    const [x, y, z, v, snr] = arrays.cloud.values.subarray(5 * k, 5 * k + 5), [sx, sy] = see([x, y, z]);
    g.fillStyle = `rgb(${colour(page.velocityMap, Math.round(127 * (1 + Math.max(-1, Math.min(1, v / speed)))))})`;
    g.strokeStyle = INK; g.lineWidth = 0.8; g.beginPath();
    g.arc(sx, sy, 2.5 + 0.12 * Math.max(0, Math.min(30, snr - 10)), 0, 7); g.fill(); g.stroke();
  }
  for (let k = 0; k < 128; k++) {               // colour bar of radial velocities
    g.fillStyle = `rgb(${colour(page.velocityMap, 2 * k)})`; g.fillRect(12 + k, high - 16, 1.5, 8);
  }
  g.fillStyle = MUTED; g.textAlign = "left";
  g.fillText(`−${speed} … ${speed} m/s, + receding`, 148, high - 8);
  g.textAlign = "right"; g.fillText(`grid ${step} m`, wide - 12, high - 8);
  by("counts").textContent = `${last - first} moving points, size: SNR`;
}

function show(frame) {
  now = Math.max(0, Math.min(page.times.length - 1, frame));
  by("slider").value = now;
  by("moment").textContent = `frame ${page.frames[now]} of 0–${page.all - 1} · ${page.times[now].toFixed(3)} s`;
  page.labels.forEach((label, k) => { by("rows").rows[k].cells[1].textContent = label.texts[now] === "–" ? "–" : `${label.texts[now]} ${label.unit}`; });
  drawScene();
  panels.forEach(draw => draw());
}

function play(on) {
  playing = on; by("play").textContent = on ? "❚❚" : "▶";
  if (!on) return;
  if (now === page.times.length - 1) show(0);
  let last = performance.now();
  clock = page.times[now];
  requestAnimationFrame(function tick(time) {
    if (!playing) return;
    clock += (time - last) / 1000 * by("rate").value; last = time;
    let next = now;
    while (next < page.times.length - 1 && page.times[next + 1] <= clock) next++;
    if (next !== now) show(next);
    if (now === page.times.length - 1) return play(false);
    requestAnimationFrame(tick);
  });
}

function start() {
  for (const name of ["title", "radar", "conventions", "report"]) by(name).textContent = page[name];
  if (page.frames.length < page.all) by("radar").textContent += ` · one of ${page.frames[1]} frames is on this page`;
  for (const label of page.labels) {
    const row = by("rows").insertRow();
    row.insertCell().textContent = page.actors.length > 1 && label.actor ? `${label.actor}: ${label.name}` : label.name;
    row.insertCell();
  }
  if (!page.labels.length) by("rows").insertRow().insertCell().textContent = "none";
  const main = document.querySelector("main").classList;
  main.toggle("plain", !page.pir.length); main.toggle("bare", !page.rangeDoppler);
  const any = part => page.actors.some(actor => arrays[`${actor.array}.${part}`].size);
  for (const [id, there] of [["showMesh", any("mesh")], ["showJoints", any("joints")], ["showCloud", arrays.cloud.size]])
    by(id).disabled = !there;
  if (page.rangeDoppler) panels.push(panel("pictures", page.rangeDoppler));
  for (const plot of page.pir) panels.push(panel("images", plot));
  for (const plot of page.spectrograms) panels.push(panel("times", plot));
  by("slider").max = page.times.length - 1;
  by("slider").oninput = () => { play(false); show(+by("slider").value); };
  by("play").onclick = () => play(!playing);
  for (const id of ["showMesh", "showJoints", "showCloud"]) by(id).onchange = drawScene;
  document.onkeydown = event => {
    if (event.key !== " " || /BUTTON|INPUT|SELECT|SUMMARY/.test(event.target.tagName)) return;
    event.preventDefault(); play(!playing);
  };
  const scene = by("scene");
  scene.onpointerdown = event => scene.setPointerCapture(event.pointerId);
  scene.onpointermove = event => {
    if (!event.buttons) return;
    if (event.shiftKey) { eye.right += event.movementX; eye.up += event.movementY; }
    else { eye.turn -= event.movementX / 150; eye.lift = Math.max(-1.5, Math.min(1.5, eye.lift + event.movementY / 150)); }
    drawScene();
  };
  scene.onwheel = event => { event.preventDefault(); eye.zoom *= Math.exp(-event.deltaY / 600); drawScene(); };
  scene.ondblclick = () => { Object.assign(eye, HOME); drawScene(); };
  addEventListener("resize", () => show(now));
  show(page.start);
}
unpack().then(found => { arrays = found; start(); });
