"""What an Infineon Position2Go sees: distance in cells of 75 cm, speed, a side from two channels, and no height.

    python examples/position2go.py              angles in steps of 4 degrees
    python examples/position2go.py --quick      in steps of 16 degrees

Prints what it finds of moving metal balls, and draws a range-Doppler map, the angles that either hardware version
measures, and where targets above and below the horizon seem to be.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.processing import point_cloud, range_doppler

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--quick", action="store_true", help="fewer angles")
parser.add_argument("--output", type=Path, default=Path("position2go.png"), help="picture to draw")
arguments = parser.parse_args()

sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.1)


def ball(name: str, distance: float, azimuth: float, elevation: float, velocity: float) -> rfgen.Actor:
    """A metal ball in a direction [deg] from the radar at the origin, receding at `velocity` [m/s]."""
    a, e = np.radians([azimuth, elevation])
    away = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return rfgen.Actor.from_mesh(
        sphere, name=name, material="metal", position=(distance + 0.1) * away, velocity=velocity * away
    )


def capture(radar: rfgen.Radar, *balls: rfgen.Actor, seed: int = 0) -> np.ndarray:
    return rfgen.Simulator(None, radar, balls).adc(duration=radar.waveform.frame_period, seed=seed).data[0]


def found(radar: rfgen.Radar, *balls: rfgen.Actor, seed: int = 0):
    """The strongest target."""
    return point_cloud(capture(radar, *balls, seed=seed), radar, max_points=1)


radar = rfgen.Radar.load("position2go")
print(f"range cell {radar.range_resolution:.2f} m to {radar.max_range:.0f} m, speed cell", end=" ")
print(f"{radar.velocity_resolution:.2f} m/s to ±{radar.max_velocity:.1f} m/s")
figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")

# Range and speed: a lone ball, two 40 cm apart at one speed, and two at one place with different speeds.
targets = [(4.0, -2.0), (9.0, 3.0), (9.4, 3.0), (14.0, -4.5), (14.0, 1.5)]  # m, m/s; none hides another
sides = [-20, -10, 0, 10, 20]
spectrum = range_doppler(
    capture(radar, *(ball(f"ball {a}", r, a, 0, v) for (r, v), a in zip(targets, sides, strict=True))), radar,
    range_bins=256, velocity_bins=64, correct_coupling=True,
)  # fmt: skip
level = 10 * np.log10(spectrum.power) + 30
mesh = axes[0].pcolormesh(spectrum.velocity, spectrum.range, level, vmin=level.max() - 50, shading="nearest")
axes[0].plot([v for _, v in targets], [r for r, _ in targets], "r+", markersize=12, label="the balls")
axes[0].set(xlabel="radial velocity [m/s], receding is positive", ylabel="range [m]", ylim=(0, 20))
axes[0].set_title("five balls; the two 40 cm apart are one")
axes[0].legend(loc="lower right")
figure.colorbar(mesh, ax=axes[0], label="level [dBm]")
one = found(radar, ball("ball", 4.0, 20, 0, -2.0))
print(f"ball at 4 m, +20 deg, -2 m/s: found at {one.range[0]:.2f} m", end=", ")
print(f"{np.degrees(one.azimuth[0]):+.1f} deg, {one.velocity[0]:+.2f} m/s, {one.snr_db[0]:.0f} dB")

# The side, from the phase between two receivers: more than half a wavelength apart it is ambiguous far out.
azimuths = np.arange(-80, 81, 16 if arguments.quick else 4)
for name, mark in (("position2go", "o"), ("position2go_v11", "x")):
    other = rfgen.Radar.load(name)
    angles = [
        np.degrees(found(other, ball("ball", 3.0, a, 0, -2.0), seed=n).azimuth[0]) for n, a in enumerate(azimuths)
    ]
    spacing = 1e3 * np.ptp(other.rx_positions[:, 1])
    limit = np.degrees(np.arcsin(min(1.0, other.wavelength / 2 / (1e-3 * spacing))))
    wrong = int(np.sum(np.abs(np.subtract(angles, azimuths)) > 10))
    print(f"{name}: antennas {spacing:.2f} mm apart, unambiguous to ±{limit:.0f} deg, {wrong} of {len(angles)} wrong")
    axes[1].plot(azimuths, angles, mark, label=f"{name}, {spacing:.2f} mm")
axes[1].plot([-80, 80], [-80, 80], color="grey", linewidth=0.8)
axes[1].set(xlabel="true azimuth [deg], left is positive", ylabel="found azimuth [deg]")
axes[1].set_title("two channels measure a side")
axes[1].legend()

# No height: whatever is above or below seems to be on the horizon.
for elevation in (-12, -6, 0, 6, 12):
    for azimuth in (-30, 0, 30):
        seen = found(radar, ball("ball", 5.0, azimuth, elevation, -2.0))
        shown = np.degrees([seen.azimuth[0], seen.elevation[0]])
        axes[2].plot([azimuth, shown[0]], [elevation, shown[1]], color="lightgrey", zorder=0)
        axes[2].plot(*shown, "C0o", label="found" if (azimuth, elevation) == (0, 0) else None)
        axes[2].plot(azimuth, elevation, "r+", label="true" if (azimuth, elevation) == (0, 0) else None)
axes[2].set(xlabel="azimuth [deg], left is positive", ylabel="elevation [deg]", xlim=(45, -45), ylim=(-20, 20))
axes[2].set_title("and no height")
axes[2].legend()
figure.savefig(arguments.output, dpi=110)
print(f"picture    {arguments.output}")
