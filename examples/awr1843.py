"""A person doing jumping jacks and a metal ball rolling away, seen by a TI AWR1843 in a living room.

    python examples/awr1843.py              one second in the room
    python examples/awr1843.py --quick      one frame in free space

Prints what paths, PIR and ADC cube say about the ball, and draws the frame's range-Doppler map, what point clouds find
in all frames, and what the radar cannot see: two balls as two where they are closer than 15 degrees. What is faster
than 4.4 m/s folds.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.processing import point_cloud, range_azimuth, range_doppler

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--quick", action="store_true", help="one frame in free space")
parser.add_argument("--output", type=Path, default=Path("awr1843.png"), help="picture to draw")
arguments = parser.parse_args()

# A radar, a place, and what moves in it. World: metres, z up; positive velocities recede from the radar.
radar = rfgen.Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
scene = None if arguments.quick else rfgen.load_scene("living_room")
person = rfgen.Actor.from_prompt("a person doing jumping jacks, facing the radar, at 3 m", seed=0, radar=radar)
ball = rfgen.Actor.from_mesh(
    trimesh.creation.icosphere(subdivisions=4, radius=0.05),
    name="ball", material="metal", position=(1.5, 0.5, 1.0), velocity=(0.5, 0.0, 0.0),
)  # fmt: skip
sim = rfgen.Simulator(scene, radar, [person, ball])

# Paths: every facet that returns energy, with its label.
paths = sim.paths(t=0.0)
of_ball = paths.object_id == paths.object_names.index("ball")
weight = np.abs(paths.a[0, 0, of_ball, 0]) ** 2
print(f"paths       {paths.num_paths}, {of_ball.sum()} of them from the ball")
print(f"ball, true  range {np.average(paths.range[of_ball, 0], weights=weight):.3f} m", end=", ")
print(f"velocity {np.average(paths.velocity[of_ball, 0], weights=weight):+.3f} m/s")

# PIR: the same instant as an image, free of any hardware.
pir = sim.pir(t=0.0, resolution=(64, 64) if arguments.quick else (128, 128), fov_deg=60)
print(f"PIR         {np.count_nonzero(pir.energy)} of {pir.energy.size} pixels return energy")

# ADC cube: (frame, chirp, tx, rx, sample), with thermal noise from the seed.
period = radar.waveform.frame_period
adc = sim.adc(duration=period if arguments.quick else 1.0, seed=0)
print(f"ADC cube    {adc.data.shape} {adc.data.dtype}")

# And back: what signal processing finds where the ball is.
found = point_cloud(adc.data[0], radar)
nearest = np.argmin(np.linalg.norm(found.position - ball.position, axis=1))
x, y, z = found.position[nearest]
print(
    f"ball, found at ({x:.2f}, {y:.2f}, {z:.2f}) m, {found.velocity[nearest]:+.3f} m/s, {found.snr_db[nearest]:.0f} dB"
)

figure, axes = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
spectrum = range_doppler(adc.data[0], radar)
level = 10 * np.log10(spectrum.power) + 30
mesh = axes[0].pcolormesh(spectrum.velocity, spectrum.range, level, vmin=level.max() - 70, shading="nearest")
axes[0].set(xlabel="radial velocity [m/s], receding is positive", ylabel="range [m]", ylim=(0, 6))
axes[0].set_title("one frame: jumping jacks at 3 m, ball at 1.6 m")
figure.colorbar(mesh, ax=axes[0], label="level [dBm]")

# What moves, from above: points of all frames over where body and ball are in the first one.
for actor in (person, ball):
    vertices = actor.vertices(0.0)
    axes[1].plot(-vertices[:, 1], vertices[:, 0], ".", color="lightgrey", markersize=2, zorder=0)
clouds = [point_cloud(frame, radar) for frame in adc.data]
x, y, _ = np.concatenate([cloud.position for cloud in clouds]).T
speed = np.concatenate([cloud.velocity for cloud in clouds])
dots = axes[1].scatter(-y, x, c=speed, s=30, cmap="coolwarm", vmin=-2, vmax=2, edgecolors="k", linewidths=0.4)
axes[1].set(xlabel="to the right [m]", ylabel="ahead [m]", xlim=(-2, 2), ylim=(0, 4.5))
axes[1].set_title("points of all frames; what rests is left out")
figure.colorbar(dots, ax=axes[1], label="radial velocity [m/s]")


def one_frame(*balls: tuple[float, float]) -> np.ndarray:
    """Balls in free space at 3 m: azimuth [deg], velocity away from the radar [m/s]."""
    sphere, actors = trimesh.creation.icosphere(subdivisions=4, radius=0.05), []
    for azimuth, velocity in balls:
        away = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
        pose = {"position": 3 * away + [0, 0, 1], "velocity": velocity * away}
        actors.append(rfgen.Actor.from_mesh(sphere, name=f"ball at {azimuth:g} deg", material="metal", **pose))
    return rfgen.Simulator(None, radar, actors).adc(duration=period, seed=1).data[0]


# What it cannot see: eight elements in a row make beams 15 degrees wide.
azimuths = np.radians(np.linspace(-40, 40, 321))
for apart, color in ((24, "C0"), (8, "C1")):
    cube = one_frame((apart / 2, 0.5), (-apart / 2, 0.5))
    found = range_azimuth(cube, radar, azimuth=azimuths, static=False, array_window="none")
    near = found.power[np.abs(found.range - 3) < 0.2].max(axis=0)
    cut = 10 * np.log10(near / near.max())
    peaks = np.sum((cut[1:-1] > cut[:-2]) & (cut[1:-1] >= cut[2:]) & (cut[1:-1] > -6))
    print(f"two balls   {apart} deg apart: {peaks} found")
    axes[2].plot(np.degrees(azimuths), cut, color, label=f"{apart} deg apart: {peaks}")
    for side in (-apart / 2, apart / 2):
        axes[2].axvline(side, color=color, linestyle=":")
axes[2].set(xlabel="azimuth [deg], left is positive", ylabel="level [dB]", xlim=(40, -40), ylim=(-25, 2))
axes[2].set_title("two balls at 3 m, too close they are one")
axes[2].legend(loc="upper right")

# And what is too fast seems to be slow, unless the array is asked which fold it is.
fast = one_frame((0.0, 6.0))
folded, unfolded = (point_cloud(fast, radar, max_points=1, ambiguities=n).velocity[0] for n in (0, 1))
print(
    f"at +6 m/s   found {folded:+.2f} m/s of at most {radar.max_velocity:.2f}; with ambiguities=1 {unfolded:+.2f} m/s"
)
figure.savefig(arguments.output, dpi=110)
print(f"picture     {arguments.output}")
