"""Motion of the library and variations by the learned model, as a radar sees them: micro-Doppler side by side.

    python examples/generated_motion.py              walking, two and a half seconds
    python examples/generated_motion.py --quick      one frame

`--prompt SENTENCE`, once or more, asks for other motions, a row each; with `--clip FILE` (AMASS .npz, .bvh, MDM or
HumanML3D .npy), once for each prompt and "-" for none, captured motions stand beside them.
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
parser.add_argument("--prompt", action="append", help="a motion; repeat for more rows")
parser.add_argument("--clip", action="append", default=[], help="a captured motion for each prompt, '-' for none")
parser.add_argument("--duration", type=float, default=2.5, help="of each spectrogram [s]")
parser.add_argument("--output", type=Path, default=Path("generated_motion.png"), help="picture to draw")
arguments = parser.parse_args()
prompts = arguments.prompt or ["a person walking back and forth"]

# One channel is enough for Doppler.
radar = rfgen.Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
radar = replace(
    radar,
    waveform=replace(radar.waveform, tx_order=(0,), num_loops=384, num_samples=64),
    tx_positions=radar.tx_positions[:1], tx_names=radar.tx_names[:1],
    rx_positions=radar.rx_positions[:1], rx_names=radar.rx_names[:1],
)  # fmt: skip
duration = radar.waveform.frame_period if arguments.quick else arguments.duration

sources = ["auto", "diffusion"] + ["captured"] * bool(arguments.clip)
shape = (len(prompts), len(sources))
size = (4.2 * shape[1], max(3.6, 1.9 * shape[0]))
figure, axes = plt.subplots(*shape, figsize=size, sharex=True, sharey=True, squeeze=False)
for row, prompt in enumerate(prompts):
    people = {
        name: Actor.from_prompt(prompt, seed=1, duration=duration + 0.5, radar=radar, motion=name)
        for name in sources[:2]
    }
    clip = arguments.clip[row] if row < len(arguments.clip) else "-"
    if clip != "-":
        people["captured"] = Actor.from_motion(clip, body=people["auto"].body, radar=radar)
    for panel, name in zip(axes[row], sources, strict=True):
        if name not in people:
            panel.set_axis_off()
            continue
        length = min(duration, people[name].duration)
        adc = rfgen.Simulator(None, radar, [people[name]], rtol=1e-2).adc(duration=length, noise=False)
        seen = micro_doppler(adc.data, radar, frame_times=adc.frame_times, static=True)
        level = 10 * np.log10(np.maximum(seen.power, 1e-30))
        panel.pcolormesh(seen.time, seen.velocity, level.T, vmin=level.max() - 50, vmax=level.max(), shading="nearest")
        panel.set_title(name if len(prompts) == 1 else f"{prompt}: {name}", fontsize=8 if len(prompts) > 1 else 12)
        panel.set_ylim(-4, 4)
        peak = seen.velocity[seen.power.sum(axis=0).argmax()]
        print(f"{name:<10}  strongest at {peak:+.2f} m/s")
for panel in axes[-1]:
    panel.set_xlabel("time [s]")
for panels in axes:
    panels[0].set_ylabel("radial velocity [m/s]" if len(prompts) == 1 else "[m/s]")
figure.tight_layout()
figure.savefig(arguments.output, dpi=110)
print(f"picture     {arguments.output}")
