"""Breathing before an Infineon BGT60TR13C: a simulated chest, and a recording of a real one beside it.

    python examples/bgt60tr13c.py                          simulation alone, 20 s
    python examples/bgt60tr13c.py --data FOLDER            with a recording: radar.npy and config.json
    python examples/bgt60tr13c.py --quick                  12 s

A recording to try: the folder of github.com/zharfanw/bgt60tr13c_processing with radar.npy and config.json. Prints range
and rate, and draws range profiles over time and displacements.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.processing import displacement, range_axis, range_spectrum
from rfgen_sionna.signal.formats import open_capture

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--data", type=Path, help="folder of a recording with radar.npy and config.json")
parser.add_argument("--quick", action="store_true", help="12 s instead of 20")
parser.add_argument("--rate", type=float, default=0.25, help="breaths a second of the simulated chest")
parser.add_argument("--depth", type=float, default=4.5, help="amplitude of the simulated chest [mm]")
parser.add_argument("--output", type=Path, default=Path("bgt60tr13c.png"), help="picture to draw")
arguments = parser.parse_args()

recorded = open_capture(arguments.data) if arguments.data else None
radar = recorded.radar if recorded else rfgen.Radar.load("bgt60tr13c", preset="breathing")


def place(t: float) -> tuple[float, float, float]:
    """Centre of the chest [m]; its front is at 0.33 m."""
    return 0.45 + 1e-3 * arguments.depth * np.sin(2 * np.pi * arguments.rate * t), 0.0, 0.0


chest = rfgen.Actor.from_mesh(trimesh.creation.icosphere(3, radius=0.12), material="skin", trajectory=place)
seconds = 12.0 if arguments.quick else 20.0
simulated = rfgen.Simulator(None, radar, [chest], rtol=0.03).adc(duration=seconds, seed=0)

cubes = {"simulated": simulated.data} | ({"recorded": recorded.cube().data} if recorded else {})
figure, axes = plt.subplots(2, len(cubes), figsize=(6.5 * len(cubes), 6.5), layout="constrained", squeeze=False)
for (name, cube), (above, below) in zip(cubes.items(), axes.T, strict=True):
    found = displacement(cube, radar)
    print(f"{name}: {found.range:.2f} m, {found.rate():.3f} breaths a second, {len(cube)} frames")
    profiles = np.abs(range_spectrum(cube.mean(axis=1, keepdims=True), radar, bins=256)[:, 0, 0, 0])
    level = 20 * np.log10(profiles / profiles.max() + 1e-9)
    above.pcolormesh(found.time, range_axis(radar, 256), level.T, vmin=-50, cmap="inferno", shading="nearest")
    above.axhline(found.range, color="white", linewidth=0.6, linestyle="--")
    above.set(title=name, ylabel="range [m]")
    below.plot(found.time, 1e3 * found.displacement)
    below.set(xlabel="time [s]", ylabel="displacement [mm]", title=f"{60 * found.rate():.1f} breaths a minute")
figure.savefig(arguments.output, dpi=110)
print(f"picture    {arguments.output}")
