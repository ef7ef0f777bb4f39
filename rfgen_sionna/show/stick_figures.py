"""Motion as rows of stick figures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import NUM_BODY_JOINTS, forward_kinematics, global_rotations
from rfgen_sionna.show.style import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rfgen_sionna._types import FloatArray
    from rfgen_sionna.records import Motion

POSES = 10
"""Number of figures in a row."""
_SPACE = 0.95
"""From one pose to the next [m]."""


def body_joints(motion: Motion) -> FloatArray:
    """(frame, 22, 3) positions of the body's joints [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :NUM_BODY_JOINTS]


def draw_stick_figures(motions: Mapping[str, Motion], path: Path) -> None:
    """Write a picture (PNG, PDF or SVG) with a row of ten poses, evenly spaced in time, for each motion.

    People who face +x face to the right and towards the eye; the left side is red, the right one blue.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((7.5, 1.75 * len(motions)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(motions), 1, squeeze=False)
    for axes, (label, motion) in zip(grid[:, 0], motions.items(), strict=True):
        stick_figures(axes, motion)
        axes.set_title(f"{label}  ({motion.duration:.1f} s)", loc="left", fontsize=8, color=INK, pad=2)
    figure.savefig(path, dpi=100)


def stick_figures(axes: Axes, motion: Motion | None) -> None:
    """Row of ten poses; an empty one for None."""
    axes.set_aspect("equal")
    axes.set_xlim(-1.0, _SPACE * POSES)
    axes.set_ylim(-0.05, 2.35)
    axes.set_axis_off()
    if motion is None:
        return
    places = body_joints(motion)
    for k, frame in enumerate(np.rint(np.linspace(0, len(places) - 1, POSES)).astype(int)):
        pose = places[frame]
        x = _SPACE * k + 0.75 * (pose[:, 0] - pose[0, 0]) - 0.66 * (pose[:, 1] - pose[0, 1])
        for j in range(1, NUM_BODY_JOINTS):
            p = motion.parents[j]
            left, right = (motion.joint_names[j].startswith(side) for side in ("left", "right"))
            colour = "tab:red" if left else "tab:blue" if right else "k"
            axes.plot([x[p], x[j]], [pose[p, 2], pose[j, 2]], color=colour, lw=1.1)
    axes.axhline(0.0, color="0.7", lw=0.6)
