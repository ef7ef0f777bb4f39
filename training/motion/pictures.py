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
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.drafts import canonical_sentence
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import NUM_BODY_JOINTS, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion
from training.motion.mocap import MocapClip, read_pack

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
_POSES = 10
_SPACE = 0.95
"""From one pose to the next [m]."""


def body_joints(motion: Motion) -> FloatArray:
    """(frame, 22, 3) joint positions [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :NUM_BODY_JOINTS]


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
            _strip(axes, motions.get(name))
            if action == actions[0]:
                axes.set_title(name, fontsize=10)
        row[0].text(-1.0, 2.25, ACTIONS[action].description, fontsize=9, va="center")
    figure.savefig(path, dpi=100)


def _strip(axes: Axes, motion: Motion | None) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(-1.0, _SPACE * _POSES)
    axes.set_ylim(-0.05, 2.35)
    axes.set_axis_off()
    if motion is None:
        return
    places = body_joints(motion)
    for k in range(_POSES):
        pose = places[round(k * (len(places) - 1) / (_POSES - 1))]
        # seen half from the side: the person faces to the right and towards the eye
        x = _SPACE * k + 0.75 * (pose[:, 0] - pose[0, 0]) - 0.66 * (pose[:, 1] - pose[0, 1])
        for j in range(1, NUM_BODY_JOINTS):
            p = motion.parents[j]
            left, right = (motion.joint_names[j].startswith(side) for side in ("left", "right"))
            colour = "tab:red" if left else "tab:blue" if right else "k"
            axes.plot([x[p], x[j]], [pose[p, 2], pose[j, 2]], color=colour, lw=1.1)
    axes.axhline(0.0, color="0.7", lw=0.6)


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
