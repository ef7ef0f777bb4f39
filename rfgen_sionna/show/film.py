"""Film of a run: the scene with the point cloud, and the range-Doppler map beside it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]
from numpy.typing import NDArray
from PIL import Image

from rfgen_sionna.show.actor_shapes import actor_shapes
from rfgen_sionna.show.displayable import Displayable, displayed
from rfgen_sionna.show.page import headline, velocity_limit
from rfgen_sionna.show.panels import draw_range_doppler
from rfgen_sionna.show.picture_file import picture_file
from rfgen_sionna.show.run_view import display_range, view_frame
from rfgen_sionna.show.scene_plot import PlotLimits, draw_scene
from rfgen_sionna.show.style import INK
from rfgen_sionna.signal.formats import Capture

Picture = NDArray[np.uint8]


def animation(
    run: Displayable | Capture | str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    dpi: int = 90,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Film of a run at its own speed.

    Parameters
    ----------
    run
        An open run, an open capture, or the path of a run.
    output
        GIF file.
    overwrite
        Whether an existing film is replaced.
    dpi
        Pixels per inch of a picture of 11 × 5 inches.
    progress
        Called with the number of finished frames and of all frames; None calls nothing.

    Returns the path of the written file. Errors are those of :func:`~rfgen_sionna.show.sheet`.
    """
    with picture_file(output, overwrite, (".gif",)) as (made, _), displayed(run) as source:
        pictures = _pictures(source, dpi, progress)
        times = source.frame_times
        _gif(pictures, made, float(np.median(np.diff(times))) if len(times) > 1 else 1.0)
    return Path(output)


def _pictures(run: Displayable, dpi: int, progress: Callable[[int, int], None] | None) -> list[Picture]:
    """One picture a frame, all with the same limits and colours."""
    shapes = actor_shapes(run)
    limits = PlotLimits.of(run, shapes)
    views = [view_frame(run, frame, static=False) for frame in range(len(run))]
    far = max(display_range(run, frame, shapes) for frame in (0, len(run) - 1))
    speed = velocity_limit(np.concatenate([view.cloud.velocity for view in views]))
    top = float(np.ceil(max(view.range_doppler.max() for view in views)))
    pictures = []
    for frame, view in enumerate(views):
        page = Figure(figsize=(11, 5), dpi=dpi, facecolor="white")
        canvas = FigureCanvasAgg(page)
        space = cast(Axes3D, page.add_axes((0.0, -0.02, 0.56, 0.88), projection="3d"))
        draw_scene(page, space, run, frame, view.cloud, limits=limits, shapes=shapes, speed=speed, zoom=1.4)
        draw_range_doppler(page, page.add_axes((0.61, 0.13, 0.3, 0.7)), view, far, top)
        page.text(0.015, 0.945, headline(run), fontsize=12.5, fontweight="bold", color=INK)
        page.text(0.985, 0.945, f"{run.frame_times[frame]:.2f} s", fontsize=12, color=INK, ha="right")
        canvas.draw()
        pictures.append(np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3]))
        if progress is not None:
            progress(frame + 1, len(run))
    return pictures


def _gif(pictures: list[Picture], target: Path, interval: float) -> None:
    # One palette for all frames, so that colours do not flicker.
    joint = Image.fromarray(np.concatenate(pictures[:: max(1, len(pictures) // 6)])).quantize(255)
    frames = [Image.fromarray(picture).quantize(palette=joint, dither=Image.Dither.NONE) for picture in pictures]
    duration = max(20, round(interval * 1e3))
    frames[0].save(target, "GIF", save_all=True, append_images=frames[1:], duration=duration, loop=0, optimize=True)
