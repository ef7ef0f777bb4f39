"""Film of a run: the scene with the point cloud, and the range-Doppler map beside it."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import warnings
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import cast

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]
from numpy.typing import NDArray
from PIL import Image

from rfgen_sionna.dataset import Run, check_output
from rfgen_sionna.show.page import headline, velocity_limit
from rfgen_sionna.show.panels import INK, draw_range_doppler
from rfgen_sionna.show.run_view import display_range, opened, view_frame
from rfgen_sionna.show.scene_plot import DecimatedMesh, PlotLimits, draw_scene

Picture = NDArray[np.uint8]


def animation(
    run: Run | str | os.PathLike[str],
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
        An open run or the path of one.
    output
        File that ends in .mp4 or .gif. MP4 needs ffmpeg (on the path, or from the package imageio-ffmpeg); without
        it a GIF of the same name is written, with a warning.
    overwrite
        Whether an existing film is replaced.
    dpi
        Pixels per inch of a picture of 11 × 5 inches.
    progress
        Called with the number of finished frames and of all frames; None calls nothing.

    Returns
    -------
    Path of the written file.

    Raises
    ------
    OutputError
        If the file exists or its folder is missing or not writable.
    ValueError
        If `output` has another suffix.
    """
    target = Path(output)
    if target.suffix not in (".mp4", ".gif"):
        raise ValueError(f"output '{target}' ends in '{target.suffix}'; allowed: .mp4, .gif")
    encoder = _ffmpeg() if target.suffix == ".mp4" else None
    if target.suffix == ".mp4" and encoder is None:
        target = target.with_suffix(".gif")
        warnings.warn(
            f"no ffmpeg found (install it, or the package imageio-ffmpeg): writing '{target}' instead of an MP4",
            stacklevel=2,
        )
    check_output(target, overwrite)
    with opened(run) as source:
        pictures = _pictures(source, dpi, progress)
        times = source.frame_times
        interval = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.") as folder:
        made = Path(folder) / target.name
        if encoder is None:
            _gif(pictures, made, interval)
        else:
            _mp4(pictures, made, interval, encoder)
        os.replace(made, target)
    return target


def _pictures(run: Run, dpi: int, progress: Callable[[int, int], None] | None) -> list[Picture]:
    """One picture a frame, all with the same limits and colours."""
    limits = PlotLimits.of(run)
    meshes = {name: DecimatedMesh.of(actor) for name, actor in run.actors.items()}
    views = [view_frame(run, frame, static=False) for frame in range(len(run))]
    far = max(display_range(run, frame) for frame in (0, len(run) - 1))
    speed = velocity_limit(np.concatenate([view.cloud.velocity for view in views]))
    top = float(np.ceil(max(view.range_doppler.max() for view in views)))
    pictures = []
    for frame, view in enumerate(views):
        page = Figure(figsize=(11, 5), dpi=dpi, facecolor="white")
        canvas = FigureCanvasAgg(page)
        space = cast(Axes3D, page.add_axes((0.0, -0.02, 0.56, 0.88), projection="3d"))
        draw_scene(page, space, run, frame, view.cloud, limits=limits, meshes=meshes, speed=speed, zoom=1.4)
        draw_range_doppler(page, page.add_axes((0.61, 0.13, 0.3, 0.7)), view, far, top)
        page.text(0.015, 0.945, headline(run), fontsize=12.5, fontweight="bold", color=INK)
        page.text(0.985, 0.945, f"{run.frame_times[frame]:.2f} s", fontsize=12, color=INK, ha="right")
        canvas.draw()
        picture = np.asarray(canvas.buffer_rgba())[..., :3]
        # Video codecs take even sizes only.
        pictures.append(np.ascontiguousarray(picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]))
        if progress is not None:
            progress(frame + 1, len(run))
    return pictures


def _gif(pictures: list[Picture], target: Path, interval: float) -> None:
    # One palette for all frames, so that colours do not flicker.
    joint = Image.fromarray(np.concatenate(pictures[:: max(1, len(pictures) // 6)])).quantize(255)
    frames = [Image.fromarray(picture).quantize(palette=joint, dither=Image.Dither.NONE) for picture in pictures]
    frames[0].save(
        target, save_all=True, append_images=frames[1:], duration=max(20, round(interval * 1e3)), loop=0, optimize=True
    )


def _mp4(pictures: list[Picture], target: Path, interval: float, encoder: str) -> None:
    height, width, _ = pictures[0].shape
    command = [
        encoder, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
        "-r", f"{1 / interval:.6f}", "-i", "-", "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20",
        "-movflags", "+faststart", str(target),
    ]  # fmt: skip
    done = subprocess.run(command, input=b"".join(p.tobytes() for p in pictures), capture_output=True, check=False)
    if done.returncode:
        raise RuntimeError(f"ffmpeg ({encoder}) failed: {done.stderr.decode(errors='replace').strip()}")


def _ffmpeg() -> str | None:
    """Path of an ffmpeg; None if none is installed."""
    if found := shutil.which("ffmpeg"):
        return found
    if find_spec("imageio_ffmpeg") is None:
        return None
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except RuntimeError:
        return None
