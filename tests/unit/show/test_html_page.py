"""The page of a run: what its data say, what a browser makes of it, what a hostile text cannot do."""

import base64
import json
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest
import trimesh

from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, OutputError, RunInfo, RunWriter, open_run
from rfgen_sionna.show import html_page, sheet
from rfgen_sionna.show.page_data import MOST_FRAMES, page_data
from tests.unit.dataset.small_sets import write_part

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
HOSTILE = (
    "</script><script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">{{title}} & <b>"
)
AHEAD = np.array([2.0, 0.0, 1.0])
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
STEADY = "<script>requestAnimationFrame = step => setTimeout(() => step(performance.now()), 20)</script></head>"
"""Frames of an animation on the browser's virtual clock."""
PROBE = """<script>
const wait = setInterval(() => {
  if (!document.getElementById("moment").textContent) return;
  clearInterval(wait);
  const [slider, moment, scene, showMesh, button, rate] =
    ["slider", "moment", "scene", "showMesh", "play", "rate"].map(id => document.getElementById(id));
  const canvases = () => [...document.querySelectorAll("canvas")];
  const data = c => c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  const colours = c => new Set(new Uint32Array(data(c).buffer)).size;
  const shots = () => canvases().map(c => c.toDataURL());
  const changed = (a, b) => a.map((shot, k) => shot !== b[k]);
  const found = { colours: canvases().map(c => [c.getAttribute("aria-label"), colours(c)]) };
  show(0);
  const first = shots();
  slider.value = slider.max; slider.dispatchEvent(new Event("input"));
  found.moved = changed(first, shots()); found.last = moment.textContent;
  const before = shots();
  scene.dispatchEvent(new PointerEvent("pointermove", { buttons: 1, movementX: 90, movementY: -20 }));
  found.turned = changed(before, shots());
  const turned = shots();
  showMesh.click(); found.bare = changed(turned, shots());
  showMesh.click(); scene.dispatchEvent(new Event("dblclick")); found.home = changed(before, shots());
  rate.value = 1; button.click(); found.playing = button.textContent;
  let checks = 0;
  const played = setInterval(() => {
    if (button.textContent !== "▶" && ++checks < 300) return;
    clearInterval(played);
    found.stopped = button.textContent; found.end = moment.textContent; found.title = document.title;
    const out = document.createElement("pre");
    out.id = "probe"; out.textContent = JSON.stringify(found); document.body.append(out);
  }, 50);
}, 10);
</script>"""
"""Moves the slider, turns the scene and plays, in a copy of the page without its policy."""


def parts(path):
    """Header and arrays of a page."""
    text = path.read_text(encoding="utf-8")
    header = json.loads(re.search(r'<script id="header" type="application/json">(.*?)</script>', text, re.S)[1])
    packed = re.search(r'<script id="arrays" type="text/plain">(.*?)</script>', text, re.S)[1]
    data = zlib.decompress(base64.b64decode(packed))
    arrays = {
        name: np.frombuffer(data, each["dtype"], int(np.prod(each["shape"])), each["offset"]).reshape(each["shape"])
        for name, each in header["arrays"].items()
    }
    return header, arrays


def positions(header, fractions):
    low, high = np.array(header["low"]), np.array(header["high"])
    return low + fractions / 65535 * (high - low)


def centre(plot, row, column, shape):
    """Values of a cell on the axes of a picture."""
    (left, right), (bottom, top) = plot["x"], plot["y"]
    return left + (column + 0.5) / shape[1] * (right - left), top + (row + 0.5) / shape[0] * (bottom - top)


@pytest.fixture(scope="module")
def page(run_path, tmp_path_factory):
    return html_page(run_path, tmp_path_factory.mktemp("page") / "ball.html")


def test_its_data_are_those_of_the_run(page, run):
    header, arrays = parts(page)
    assert header["times"] == pytest.approx(run.frame_times)
    for frame in (0, 3):
        ball = positions(header, arrays["actor0.mesh"][frame])
        vertices = run.actors["ball"].vertices(frame)
        np.testing.assert_allclose(ball.mean(axis=0), vertices.mean(axis=0), atol=2e-3)
        first, last = header["cloud"]["starts"][frame : frame + 2]
        cloud = arrays["cloud"][first:last]
        target = vertices.mean(axis=0)  # the target has the ball's centre
        assert np.linalg.norm(cloud[:, :3] - target, axis=1).min() < 0.1
        assert cloud[0, 3] == pytest.approx(0.8, abs=0.1)
    distance = np.linalg.norm(np.array([2.5, 1.0, 1.2]) - [0, 0, 1])
    plot, picture = header["rangeDoppler"], arrays["range_doppler"][0]
    speed, far = centre(plot, *np.unravel_index(picture.argmax(), picture.shape), picture.shape)
    assert far == pytest.approx(distance, abs=0.1)
    assert speed == pytest.approx(0.8, abs=0.15)
    for plot, truth in zip(header["spectrograms"], (distance, 0.8), strict=True):
        picture = arrays[plot["array"]][0]
        row, column = np.unravel_index(picture.argmax(), picture.shape)
        assert centre(plot, row, column, picture.shape)[1] == pytest.approx(truth, abs=0.4)
        assert plot["line"]["values"][0][0] == pytest.approx(truth, abs=1e-3)


def test_images_have_left_on_the_left_and_up_above(page, run):
    header, arrays = parts(page)
    energy = next(plot for plot in header["pir"] if plot["array"] == "pir/energy")
    assert energy["x"][0] == pytest.approx(np.tan(np.radians(35)))  # 35° to the left is the left border
    assert energy["x"][1] == -energy["x"][0]
    assert energy["y"][1] > 0
    shown = arrays["pir/energy"][0]
    assert np.all(shown[0] == 255)  # nothing there
    np.testing.assert_array_equal(shown > 200, (run.pir(0).energy > 1e-8) | (run.pir(0).energy == 0))
    assert set(np.unique(arrays["pir/velocity"][0])) == {127, 255, *np.unique(arrays["pir/velocity"][0][6:14, 2:8])}


def test_it_loads_nothing_and_texts_are_no_markup(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)\s*=|https?://|@import|url\(""", text)
    assert "default-src 'none'" in text
    assert len(text) < 2e6


def test_a_long_run_has_every_so_many_frames_and_stays_small(tmp_path, small_radar):
    box, count = trimesh.creation.box((0.3, 0.3, 0.3)), 2 * MOST_FRAMES + 2
    info = RunInfo(small_radar, actors=(ActorInfo("box", "metal", np.asarray(box.faces), 8),))
    with RunWriter(tmp_path / "long.h5", info, keep=("vertices", "joints")) as writer:
        for frame in range(count):
            writer.append(None, time=0.1 * frame, vertices={"box": box.vertices + AHEAD})
    with open_run(tmp_path / "long.h5") as run:
        header = page_data(run, "").header
    assert header["frames"] == list(range(0, count, 3))
    assert header["all"] == count


# Thresholds of order statistics of so few cells are integrals at the limit of their routine.
@pytest.mark.filterwarnings("ignore::scipy.integrate.IntegrationWarning")
def test_recordings_without_samples_or_meshes_show_what_they_store(tmp_path):
    write_part(tmp_path / "part.h5", 3, "wave", "train", keep=("joints", "labels"))
    header, arrays = parts(html_page(tmp_path / "part.h5", tmp_path / "part.html"))
    assert header["rangeDoppler"] is None
    assert header["spectrograms"] == []
    assert arrays["actor0.faces"].size == 0
    assert arrays["actor0.bones"].shape == (21, 2)
    with open_run(tmp_path / "part.h5") as run:
        joints = positions(header, arrays["actor0.joints"][2])
        np.testing.assert_allclose(joints, run.actors["person"].joints(2), atol=1e-3)
    assert "3: wave" not in header["report"]
    write_part(tmp_path / "adc.h5", 3, "wave", "train")
    header, arrays = parts(html_page(tmp_path / "adc.h5", tmp_path / "adc.html"))
    assert arrays["range_doppler"].shape[0] == 5
    assert sheet(tmp_path / "adc.h5", tmp_path / "adc.png").stat().st_size > 1e4


def test_bad_names_and_existing_files_are_refused(run_path, page, tmp_path):
    with pytest.raises(ValueError, match=r"allowed: \.html"):
        html_page(run_path, tmp_path / "page.pdf")
    with pytest.raises(OutputError, match="exists"):
        html_page(run_path, page)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def browse(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine")

    def loaded(text):
        """Document after its scripts ran, and what the console says."""
        folder = tmp_path_factory.mktemp("browser")
        (folder / "page.html").write_text(text, encoding="utf-8")
        command = [
            CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom",
            "--window-size=1400,900", "--virtual-time-budget=10000", f"--user-data-dir={folder}/profile",
            f"file://{folder}/page.html",
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]

    return loaded


def test_a_browser_draws_moves_turns_and_plays_it(page, browse):
    text = POLICY.sub("", page.read_text(encoding="utf-8"))
    text = text.replace("</head>", STEADY).replace("</body>", PROBE + "</body>")
    document, console = browse(text)
    assert console == []
    found = json.loads(re.search(r'<pre id="probe">(.*?)</pre>', document, re.S)[1].replace("&amp;", "&"))
    names = [name for name, _ in found["colours"]]
    assert names == [
        "scene in three dimensions", "Range–Doppler", "PIR energy", "PIR time of arrival", "PIR velocity",
        "Range–time", "Doppler–time",
    ]  # fmt: skip
    assert min(number for _, number in found["colours"]) > 50
    moved = dict(zip(names, found["moved"], strict=True))
    # The images of this run are alike in all frames; the cursor moves in both spectrograms.
    assert [name for name in names if moved[name]] == [names[0], names[1], names[5], names[6]]
    for step in ("turned", "bare"):
        assert found[step] == [True] + [False] * 6
    assert not any(found["home"])
    assert found["playing"] != "▶"
    assert found["stopped"] == "▶"
    assert found["end"] == found["last"]
    assert found["last"].startswith("frame 3 of 0–3")


def test_its_policy_lets_its_own_script_run_and_no_other(page, browse):
    text = page.read_text(encoding="utf-8")
    document, console = browse(text)
    assert console == []
    assert re.search(r'<output id="moment">frame \d of 0–3', document)
    assert "a ball rolling away" in document
    document, console = browse(text.replace("</body>", "<script>document.title = 'owned'</script></body>"))
    assert "<title>owned" not in document
    assert any("Content Security Policy" in line for line in console)


def test_texts_of_a_stranger_are_shown_and_not_run(tmp_path, small_radar, browse):
    box = trimesh.creation.box((0.3, 0.3, 0.3))
    actor = ActorInfo(HOSTILE.replace("/", "-"), HOSTILE, np.asarray(box.faces), 8)
    labels = {"action": STANDARD_LABELS["action"]}
    info = RunInfo(small_radar, prompt=HOSTILE, environment=HOSTILE, report=HOSTILE, actors=(actor,), labels=labels)
    with RunWriter(tmp_path / "run.h5", info) as writer:
        for frame in range(2):
            writer.append(
                np.full(small_radar.frame_shape, 1e-7, np.complex64), time=0.1 * frame,
                vertices={actor.name: box.vertices + AHEAD}, labels={"action": [HOSTILE]},
            )  # fmt: skip
    text = html_page(tmp_path / "run.h5", tmp_path / "run.html").read_text(encoding="utf-8")
    assert text.count("<script") == 3
    assert "<img" not in text
    for allowed in (text, POLICY.sub("", text)):  # not even without the policy
        document, console = browse(allowed)
        assert console == []
        assert "<title>owned" not in document
        assert "<img" not in document
        assert document.count("&lt;/script&gt;&lt;script&gt;document.title='owned'") >= 4
