"""How long the tracer takes for how small an error, against one sample per pixel.

    python tests/benchmarks/tracing.py --output tests/benchmarks/results

writes `tracing.json` and `tracing.png`. A metal sphere moves away in half millimetres. The tracer runs at a ladder of
tolerances and meshes; the other method sends a ray through the middle of every pixel and adds the points that it hits,
which is what published simulators do, re-implemented from the equations: fixed rays, and rays with fresh jitter. Truth
is the Mie series' level, referred to the near-field divergence R (R - a), with the phase -4 pi (R - a) / lambda; a
constant phase is free. Times are medians of one instant, warm, vertices update included.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.scene import Actor
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.tracer import Tracer

SEED = 0
RADIUS, RANGE, STEP, STEPS = 0.15, 3.0, 0.5e-3, 16
MESHES = (5, 6)
"""Subdivisions of the icosahedron: 20,480 and 81,920 facets."""
TOLERANCES = (1e-1, 1e-2, 1e-3)
PIXELS = (128, 256, 512, 1024)


def truth(radar: Radar, distances: FloatArray) -> np.ndarray:
    """(step,) complex gain, its constant phase left open."""
    import miepython

    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    q = miepython.efficiencies_mx(1.0 - 1e6j, 2 * np.pi * RADIUS / wavelength)[2]
    area = q * np.pi * RADIUS**2
    level = wavelength * np.sqrt(area) / ((4 * np.pi) ** 1.5 * distances * (distances - RADIUS))
    return level * np.exp(-4j * np.pi * distances / wavelength)


def relative_error(found: np.ndarray, expected: np.ndarray) -> dict[str, float]:
    """Error relative to the level, with the best constant phase, and its parts."""
    ratio = found / expected
    ratio = ratio * np.exp(-1j * np.angle(ratio.mean()))
    return {
        "relative": float(np.sqrt(np.mean(np.abs(ratio - 1) ** 2))),
        "phase_deg": float(np.degrees(np.sqrt(np.mean(np.angle(ratio) ** 2)))),
        "level_db": float(np.sqrt(np.mean((20 * np.log10(np.abs(ratio))) ** 2))),
    }


def traced(radar: Radar, subdivisions: int, rtol: float, distances: FloatArray) -> dict[str, float]:
    """The tracer on a sphere that moves."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=RADIUS)
    # Vertices on the sphere make a polyhedron that is too small: same area on the average instead.
    mesh.apply_scale(np.sqrt(4 * np.pi * RADIUS**2 / mesh.area))
    speed = STEP  # a step a second
    ball = Actor.from_mesh(mesh, material="pec", position=(RANGE, 0, 0), velocity=(speed, 0, 0), name="ball")
    tracer = Tracer(None, radar, [ball], rtol)
    run = tracer.follow()
    tracer.trace(0.0, 0.0, run)
    seconds, sums = [], []
    for step in range(len(distances)):
        begin = time.perf_counter()
        paths = tracer.trace(float(step), float(step), run).moving
        seconds.append(time.perf_counter() - begin)
        phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0)
        sums.append((paths.a[0, 0, :, 0] * np.exp(-1j * phase)).sum())
    return {"seconds": float(np.median(seconds)), **relative_error(np.array(sums), truth(radar, distances))}


def sampled(radar: Radar, pixels: int, jitter: bool, distances: FloatArray) -> dict[str, float]:
    """One sample per pixel: (j / 4 pi) times the sum of exp(-2 j k R) and the pixel's solid angle."""
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int32)
    rays = RayScene([], [(vertices + np.array([RANGE, 0, 0]), faces)], origin=np.zeros(3))
    k = 2 * np.pi * radar.center_frequency / SPEED_OF_LIGHT
    # As wide as the sphere is seen: no ray is wasted. The published ones cover the whole field of view.
    half = 1.1 * RADIUS / (RANGE - RADIUS)
    width = 2 * half / pixels
    rng = np.random.default_rng(SEED)
    middles = -half + width * (np.arange(pixels) + 0.5)
    seconds, sums = [], []
    for distance in distances:
        y, z = np.meshgrid(middles, middles)
        if jitter:
            y, z = (each + width * rng.uniform(-0.5, 0.5, each.shape) for each in (y, z))
        direction = np.stack([np.ones_like(y), y, z], axis=-1).reshape(-1, 3)
        solid = width**2 / np.linalg.norm(direction, axis=1) ** 3
        begin = time.perf_counter()
        rays.update([vertices + np.array([distance, 0, 0])])
        reach = rays.first_hit(np.zeros(3), direction).distance
        hit = np.isfinite(reach)
        sums.append((1j / (4 * np.pi)) * (solid[hit] * np.exp(-2j * k * reach[hit])).sum())
        seconds.append(time.perf_counter() - begin)
    return {"seconds": float(np.median(seconds)), **relative_error(np.array(sums), truth(radar, distances))}


def draw(result: dict[str, Any], path: Path) -> None:
    """Time against error, both logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4))
    for name, style in (("tracer", "o-"), ("fixed rays", "s--"), ("jittered rays", "^:")):
        rows = sorted((each for each in result["runs"] if each["method"] == name), key=lambda row: row["seconds"])
        axes.loglog([1e3 * row["seconds"] for row in rows], [row["relative"] for row in rows], style, label=name)
    axes.set_xlabel("time of an instant [ms]")
    axes.set_ylabel("relative error of the return")
    axes.set_title(f"metal sphere of {100 * RADIUS:g} cm at {RANGE:g} m, 77 GHz, moved by half millimetres", fontsize=9)
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def measure(
    meshes: tuple[int, ...] = MESHES, pixels: tuple[int, ...] = PIXELS, steps: int = STEPS
) -> list[dict[str, Any]]:
    """All methods, one after the other."""
    radar = replace(Radar.load("awr1843"), pattern=ElementPattern(0.0))
    distances = RANGE + STEP * np.arange(steps)
    runs: list[dict[str, Any]] = []
    for subdivisions in meshes:
        for rtol in TOLERANCES:
            row = {"method": "tracer", "facets": 20 * 4**subdivisions, "rtol": rtol}
            runs.append(row | traced(radar, subdivisions, rtol, distances))
    for count in pixels:
        for name, jitter in (("fixed rays", False), ("jittered rays", True)):
            runs.append({"method": name, "rays": count**2} | sampled(radar, count, jitter, distances))
    return runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("."), help="folder for the JSON and the picture")
    options = parser.parse_args()
    load = list(os.getloadavg()) if hasattr(os, "getloadavg") else None
    result = {
        "command": "python tests/benchmarks/tracing.py --output tests/benchmarks/results",
        "seed": SEED,
        "machine": {"cores": os.cpu_count(), "processor": platform.processor() or platform.machine(), "load": load},
        "versions": {name: version(name) for name in ("rfgen_sionna", "numpy", "drjit", "mitsuba", "miepython")}
        | {"python": platform.python_version()},
        "runs": measure(),
    }
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "tracing.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    draw(result, options.output / "tracing.png")
    for row in result["runs"]:
        what = f"{row['facets']:,} facets, rtol {row['rtol']:g}" if row["method"] == "tracer" else f"{row['rays']:,}"
        print(
            f"{row['method']:14s} {what:28s} {1e3 * row['seconds']:8.1f} ms  error {row['relative']:.2g}  "
            f"{row['phase_deg']:.2g} deg  {row['level_db']:.2g} dB"
        )


if __name__ == "__main__":
    main()
