"""Two metal balls 2.5 degrees apart at 8 m: one target to a TI AWR1843, two to TI's cascade of four such devices.

    python examples/mmwcas.py              with a person doing jumping jacks at 5 m
    python examples/mmwcas.py --quick      the balls alone

Prints what each radar finds, and draws both range-azimuth maps and a cut through them at 8 m.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.processing import range_azimuth

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--quick", action="store_true", help="the balls alone")
parser.add_argument("--output", type=Path, default=Path("mmwcas.png"), help="picture to draw")
arguments = parser.parse_args()

DISTANCE, APART = 8.0, 2.5
sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.12)
actors = []
for name, azimuth in (("left", APART / 2), ("right", -APART / 2)):
    away = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])  # azimuth grows to the left
    actors.append(
        rfgen.Actor.from_mesh(
            sphere, name=name, material="metal", position=DISTANCE * away + [0, 0, 1], velocity=1.0 * away
        )
    )
if not arguments.quick:
    actors.append(rfgen.Actor.from_prompt("a person doing jumping jacks", position=(5, 1.5, 0), seed=0))

azimuths = np.radians(np.linspace(-30, 30, 481))
figure, axes = plt.subplots(1, 3, figsize=(15, 4.8), layout="constrained")
for axis, name in zip(axes, ("mmwcas", "awr1843"), strict=False):
    radar = rfgen.Radar.load(name, position=(0, 0, 1), look_at=(1, 0, 1))
    cube = rfgen.Simulator(None, radar, actors).adc(duration=radar.waveform.frame_period, seed=0)
    found = range_azimuth(cube.data[0], radar, azimuth=azimuths, static=False, max_range=10.5, array_window="none")
    level = 10 * np.log10(found.power) + 30

    # A cut through the balls' range cell, and its maxima.
    near = level[np.abs(found.range - DISTANCE) < 0.5]
    cut = near[near.max(axis=1).argmax()]
    peak = (cut[1:-1] > cut[:-2]) & (cut[1:-1] >= cut[2:]) & (cut[1:-1] > cut.max() - 6)
    angles = np.degrees(azimuths[1:-1][peak])
    print(f"{name:8s} {len(angles)} at {DISTANCE:g} m, azimuth " + ", ".join(f"{angle:+.2f}" for angle in angles))
    axes[2].plot(np.degrees(azimuths), cut - cut.max(), label=name)

    x, y = (found.range[:, None] * part(azimuths) for part in (np.sin, np.cos))
    mesh = axis.pcolormesh(-x, y, level, vmin=level.max() - 30, shading="gouraud")
    shape = f"{len(radar.tx_names)}×{len(radar.rx_names)}"
    axis.set_title(f"{name} ({shape}), range cell {100 * radar.range_resolution:.0f} cm")
    axis.set(xlabel="to the right [m]", ylabel="ahead [m]", xlim=(-3.5, 3.5), ylim=(0, 10.5))
    figure.colorbar(mesh, ax=axis, label="moving power [dBm]")

for angle in (-APART / 2, APART / 2):
    axes[2].axvline(angle, color="grey", linestyle=":", label="the balls" if angle > 0 else None)
axes[2].set(xlabel="azimuth [deg], left is positive", ylabel="level [dB]", xlim=(20, -20), ylim=(-25, 2))
axes[2].set_title(f"cut at {DISTANCE:g} m")
axes[2].legend(loc="upper right")
figure.savefig(arguments.output, dpi=110)
print(f"picture  {arguments.output}")
