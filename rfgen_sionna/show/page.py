"""Sheet: one page of pictures of a run."""

from __future__ import annotations

import os
from pathlib import Path
from typing import cast

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]

from rfgen_sionna.show import panels
from rfgen_sionna.show.actor_shapes import actor_shapes
from rfgen_sionna.show.displayable import Displayable, displayed
from rfgen_sionna.show.picture_file import picture_file
from rfgen_sionna.show.run_summary import radar_line
from rfgen_sionna.show.run_view import check_frame, display_range, view_frame, view_run
from rfgen_sionna.show.scene_plot import PlotLimits, draw_scene
from rfgen_sionna.show.style import INK, MUTED
from rfgen_sionna.signal.formats import Capture


def sheet(
    run: Displayable | Capture | str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    frame: int | None = None,
    overwrite: bool = False,
    dpi: int = 110,
) -> Path:
    """One page of pictures: PIR, range-Doppler and azimuth map, point cloud and mesh of one frame, spectrograms of all.

    Parameters
    ----------
    run
        An open run, an open capture, or the path of a run.
    output
        Picture file; its suffix selects the format (.png, .pdf, .jpg …).
    frame
        Frame, from 0; None takes the one with the fastest motion.
    overwrite
        Whether an existing picture is replaced.
    dpi
        Pixels per inch of a page of 16 × 10.5 inches.

    Returns
    -------
    Path of the written file.

    Raises
    ------
    OutputError
        If the file exists or its folder is missing or not writable.
    ValueError
        If the run has no such frame, or `output` has an unknown suffix.
    NoPictureError
        If the samples have no ranges.
    """
    with picture_file(output, overwrite) as (made, form), displayed(run) as source:
        page = _draw(source, None if frame is None else check_frame(source, frame))
        page.savefig(made, dpi=dpi, format=form)
    return Path(output)


def _draw(run: Displayable, frame: int | None) -> Figure:
    whole = view_run(run)
    frame = whole.most_active_frame if frame is None else frame
    view = view_frame(run, frame)
    shapes = actor_shapes(run, 12000)
    far = display_range(run, frame, shapes)
    page = Figure(figsize=(16, 10.5), facecolor="white")
    engine = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, hspace=0.03, wspace=0.02, rect=(0, 0, 1, 0.945))
    page.set_layout_engine(engine)
    rows = page.add_gridspec(3, 1, height_ratios=(1.0, 1.25, 1.0))
    top = rows[0:2].subgridspec(2, 2, width_ratios=(1.75, 1.0), height_ratios=(1.0, 1.25))
    # The scene takes the right column of both upper rows.
    if run.has_pir:
        images = top[0, 0].subgridspec(1, 3)
        panels.draw_pir(page, [page.add_subplot(images[0, i]) for i in range(3)], run.pir(frame))
        maps = top[1, 0].subgridspec(1, 2)
    else:
        maps = top[:, 0].subgridspec(1, 2)
    panels.draw_range_doppler(page, page.add_subplot(maps[0, 0]), view, far)
    panels.draw_azimuth(page, page.add_subplot(maps[0, 1]), view, far)
    space = cast(Axes3D, page.add_subplot(top[:, 1], projection="3d"))
    draw_scene(
        page, space, run, frame, view.cloud, limits=PlotLimits.of(run, shapes), shapes=shapes,
        speed=velocity_limit(view.cloud.velocity),
    )  # fmt: skip
    times = rows[2].subgridspec(1, 2)
    panels.draw_range_time(page, page.add_subplot(times[0, 0]), run, whole, far)
    panels.draw_doppler_time(page, page.add_subplot(times[0, 1]), run, whole)
    page.text(0.008, 0.985, headline(run), fontsize=15, fontweight="bold", color=INK, va="top")
    moment = f"frame {frame} of 0–{len(run) - 1}, {run.frame_times[frame]:.2f} s"
    page.text(0.992, 0.985, f"{radar_line(run)}\n{moment}", fontsize=8.5, color=MUTED, ha="right", va="top")
    return page


def headline(run: Displayable) -> str:
    """Prompt, or names of the actors, and environment."""
    text = run.prompt or ", ".join(run.actors) or "radar run"
    return f"“{text}” — {run.environment}" if run.environment else f"“{text}”"


def velocity_limit(velocity: np.ndarray) -> float:
    """Limit of the velocity colours [m/s]."""
    return max(0.5, float(np.ceil(2 * np.abs(velocity).max(initial=0.0)) / 2))
