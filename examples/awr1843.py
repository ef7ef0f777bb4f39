"""A person doing jumping jacks and a metal ball rolling away, seen by a TI AWR1843 in a living room.

    python examples/awr1843.py              one second in the room
    python examples/awr1843.py --quick      one frame in free space

Prints what paths, PIR and ADC cube say about the ball, and draws the frame's range-Doppler map.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.processing import point_cloud, range_doppler

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
sim = rfgen.Simulator(scene, radar, [person, ball], rtol=1e-3)

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

spectrum = range_doppler(adc.data[0], radar)
level = 10 * np.log10(spectrum.power) + 30
mesh = plt.pcolormesh(spectrum.velocity, spectrum.range, level, vmin=level.max() - 70, shading="nearest")
plt.ylim(0, 6)
plt.xlabel("radial velocity [m/s], receding is positive")
plt.ylabel("range [m]")
plt.title("AWR1843: jumping jacks at 3 m, ball at 1.6 m")
plt.colorbar(mesh, label="level [dBm]")
plt.savefig(arguments.output, dpi=120)
print(f"picture     {arguments.output}")
