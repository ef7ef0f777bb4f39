"""Walking from rules and from the learned model, as a radar sees it: micro-Doppler of both, side by side.

    python examples/generated_motion.py              two and a half seconds
    python examples/generated_motion.py --quick      one frame

With --clip FILE (AMASS .npz, .bvh, MDM or HumanML3D .npy) a captured motion stands beside them.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rfgen_sionna as rfgen
from rfgen_sionna.generative import Actor
from rfgen_sionna.processing import micro_doppler

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--quick", action="store_true", help="one frame")
parser.add_argument("--clip", type=Path, help="a captured motion")
parser.add_argument("--output", type=Path, default=Path("generated_motion.png"), help="picture to draw")
arguments = parser.parse_args()

# One channel is enough for Doppler.
radar = rfgen.Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
radar = replace(
    radar,
    waveform=replace(radar.waveform, tx_order=(0,), num_loops=384, num_samples=64),
    tx_positions=radar.tx_positions[:1], tx_names=radar.tx_names[:1],
    rx_positions=radar.rx_positions[:1], rx_names=radar.rx_names[:1],
)  # fmt: skip
duration = radar.waveform.frame_period if arguments.quick else 2.5

people = {
    name: Actor.from_prompt("a person walking back and forth", seed=1, duration=4.0, radar=radar, motion=name)
    for name in ("kinematic", "diffusion")
}
if arguments.clip is not None:
    people["captured"] = Actor.from_motion(arguments.clip, body=people["kinematic"].body, radar=radar)

figure, axes = plt.subplots(1, len(people), figsize=(4.2 * len(people), 3.6), sharey=True, squeeze=False)
for panel, (name, person) in zip(axes[0], people.items(), strict=True):
    adc = rfgen.Simulator(None, radar, [person], rtol=1e-2).adc(duration=duration, noise=False)
    seen = micro_doppler(adc.data, radar, frame_times=adc.frame_times, static=True)
    level = 10 * np.log10(np.maximum(seen.power, 1e-30))
    panel.pcolormesh(seen.time, seen.velocity, level.T, vmin=level.max() - 50, vmax=level.max(), shading="nearest")
    panel.set_title(name)
    panel.set_xlabel("time [s]")
    panel.set_ylim(-4, 4)
    peak = seen.velocity[seen.power.sum(axis=0).argmax()]
    print(f"{name:<10}  strongest at {peak:+.2f} m/s")
axes[0][0].set_ylabel("radial velocity [m/s]")
figure.tight_layout()
figure.savefig(arguments.output, dpi=110)
print(f"picture     {arguments.output}")
