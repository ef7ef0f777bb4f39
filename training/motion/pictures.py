"""Stick figures of synthesised, generated and captured motion side by side:
`python -m training.motion.pictures --mocap FOLDER --out FOLDER`.

Beside `strips.png` it writes the captured motions as `ACTION.npy` (joint positions at 20 Hz), from which
`examples/generated_motion.py --clip` draws spectrograms of the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np
import typer

from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.drafts import canonical_sentence
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.records import Motion
from rfgen_sionna.show.stick_figures import body_joints, stick_figures
from training.motion.mocap import MocapClip, read_pack

SHOWN = ("walk", "jump", "jumping_jacks", "pick_up", "t_pose", "left_arm_raised", "right_leg_raised")
SECONDS = 3.0
SHOTS: Mapping[str, tuple[str, int]] = MappingProxyType(
    {
        "walk": ("walk", 0),
        "jump": ("jump", 0),
        "jumping_jacks": ("jumping_jacks", 0),
        "pick_up": ("bend_pick", 0),
        "t_pose": ("t_pose", 0),
        "left_arm_raised": ("cmu_14_08", 378),
        "right_leg_raised": ("cmu_49_02_s1", 0),
    }
)
"""Action -> captured action, or clip, and the frame from which it is shown."""


def shots(captures: Sequence[MocapClip]) -> dict[str, Motion]:
    """Three seconds of captured motion of each action that the pack has."""
    out = {}
    for action, (wanted, start) in SHOTS.items():
        for capture in captures:
            count = int(SECONDS * capture.motion.frame_rate)
            long = len(capture.motion.translation) >= start + min(count, 20)
            if wanted in (capture.name, capture.action) and long:
                rows = slice(start, start + count)
                motion = capture.motion
                out[action] = replace(
                    motion, rotations=motion.rotations[rows], translation=motion.translation[rows], contacts=None
                )
                break
    return out


def strips(
    source: DiffusionSource,
    path: Path,
    actions: Sequence[str] = SHOWN,
    *,
    seed: int = 0,
    captured: Mapping[str, Motion] = MappingProxyType({}),
) -> None:
    """Draw ten poses over three seconds of each action, a row each: synthesised, generated, captured where given."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = ("kinematic", "generated", "captured") if captured else ("kinematic", "generated")
    figure = Figure((5.2 * len(columns), 1.25 * len(actions)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(actions), len(columns), squeeze=False)
    for row, action in zip(grid, actions, strict=True):
        motions = {
            "kinematic": KinematicSource(60.0)(action, SECONDS, seed),
            "generated": source.generate(canonical_sentence(action), duration=SECONDS, seed=seed),
        }
        if action in captured:
            motions["captured"] = captured[action]
        for axes, name in zip(row, columns, strict=True):
            stick_figures(axes, motions.get(name))
            if action == actions[0]:
                axes.set_title(name, fontsize=10)
        row[0].text(-1.0, 2.25, ACTIONS[action].description, fontsize=9, va="center")
    figure.savefig(path, dpi=100)


def main(
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")],
    mocap: Annotated[Path | None, typer.Option(help="Folder of the mocap pack; none: no captured column.")] = None,
    model: Annotated[Path | None, typer.Option(help="Model file; none: the one that ships.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the motions.")] = 0,
) -> None:
    """Draw stick figures of seven prompts, and write the captured motions beside them."""
    out.mkdir(parents=True, exist_ok=True)
    captured = shots(read_pack(mocap)) if mocap is not None else {}
    strips(DiffusionSource(model), out / "strips.png", seed=seed, captured=captured)
    for action, motion in captured.items():
        # y up, as HumanML3D and MDM have it
        np.save(out / f"{action}.npy", body_joints(motion)[..., [1, 2, 0]])


if __name__ == "__main__":
    typer.run(main)
