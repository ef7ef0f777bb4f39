"""Picture of simulated falls of the library: `python -m training.motion.falls.picture --out docs/images/falls.png`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rfgen_sionna.generative.action_definitions import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import rate_of
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.records import Motion
from rfgen_sionna.show.stick_figures import POSES, stick_figures
from rfgen_sionna.show.style import INK
from training.commands import plainly

SHOWN = {
    "sim_trip_000": "trips and falls forward",
    "sim_backward_000": "falls backward",
    "sim_left_000": "falls to the left",
    "sim_slip_003": "slips",
    "sim_faint_000": "faints",
    "sim_from_chair_000": "falls off a chair",
}
"""Clip -> title of its row."""
_LENGTH, _BEFORE = 1.8, 1.0
"""Time that a row shows, and time before the fastest descent of the head at which it begins [s]."""


def around_the_fall(motion: Motion) -> Motion:
    """The part in which the person falls."""
    fastest = int(np.argmin(rate_of(MotionSignals(motion).head_height)))
    first = max(0, fastest - round(_BEFORE * motion.frame_rate))
    rows = slice(first, first + round(_LENGTH * motion.frame_rate) + 1)
    return replace(motion, rotations=motion.rotations[rows], translation=motion.translation[rows], contacts=None)


@plainly
def main(out: Annotated[Path, typer.Option(help="Picture to write.")] = Path("docs/images/falls.png")) -> None:
    """Draw six falls as rows of stick figures with their times."""
    library = MotionLibrary()
    figure = Figure((7.5, 1.55 * len(SHOWN)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, title) in zip(figure.subplots(len(SHOWN), 1), SHOWN.items(), strict=True):
        motion = around_the_fall(library.motion(name))
        stick_figures(axes, motion)
        axes.set_ylim(-0.3, 1.9)
        axes.set_title(f"{title}  ({name})", loc="left", fontsize=8, color=INK, pad=2)
        for k, time in enumerate(np.linspace(0.0, motion.duration, POSES)):
            axes.text(0.95 * k, -0.08, f"{time:.1f} s", fontsize=6, color=INK, ha="center", va="top")
    figure.savefig(out, dpi=100)


if __name__ == "__main__":
    typer.run(main)
