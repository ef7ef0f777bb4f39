"""Stick figures of synthesised and generated motion, one strip above the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rfgen_sionna.generative.diffusion.source import DiffusionSource, canonical
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import NUM_BODY_JOINTS, forward_kinematics, global_rotations
from rfgen_sionna.records import FloatArray, Motion

SHOWN = ("walk", "jump", "jumping_jacks", "pick_up", "t_pose", "left_arm_raised", "right_leg_raised", "swipe_left")
_POSES = 10


def body_joints(motion: Motion) -> FloatArray:
    """(frame, 22, 3) joint positions [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :NUM_BODY_JOINTS]


def strips(
    source: DiffusionSource,
    path: Path,
    actions: Sequence[str] = SHOWN,
    *,
    seed: int = 0,
    captured: dict[str, Motion] | None = None,
) -> None:
    """Draw ten poses over three seconds of each action: synthesised, generated, and captured where given."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows: list[tuple[str, Motion]] = []
    for action in actions:
        rows.append((f"{action}\nkinematic", KinematicSource(60.0)(action, 3.0, seed, hand=None)))
        rows.append((f"{action}\ngenerated", source.generate(canonical(action), duration=3.0, seed=seed)))
        if captured and action in captured:
            rows.append((f"{action}\ncaptured", captured[action]))
    figure = Figure((8.0, 0.85 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (label, motion) in zip(np.atleast_1d(figure.subplots(len(rows), 1)), rows, strict=True):
        places = body_joints(motion)
        for k in range(_POSES):
            pose = places[round(k * (len(places) - 1) / (_POSES - 1))]
            # seen from the front and a little from the side
            x = 0.85 * k - 0.85 * (pose[:, 1] - pose[0, 1]) + 0.35 * (pose[:, 0] - pose[0, 0])
            for j in range(1, NUM_BODY_JOINTS):
                p = motion.parents[j]
                left = motion.joint_names[j].startswith("left")
                colour = "tab:red" if left else "tab:blue" if motion.joint_names[j].startswith("right") else "k"
                axes.plot([x[p], x[j]], [pose[p, 2], pose[j, 2]], color=colour, lw=1.1)
        axes.axhline(0.0, color="0.7", lw=0.6)
        axes.set_aspect("equal")
        axes.set_xlim(-2.2, 0.85 * _POSES)
        axes.set_ylim(-0.05, 2.1)
        axes.set_axis_off()
        axes.text(-2.2, 1.0, label, fontsize=7, va="center")
    figure.savefig(path, dpi=110)
