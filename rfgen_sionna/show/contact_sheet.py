"""Contact sheet: four small pictures of each of several runs, such as recordings of a data set."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import Run, open_dataset, open_run
from rfgen_sionna.processing.spectrum import watts_to_dbm
from rfgen_sionna.show.actor_shapes import ActorShape, actor_shapes
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.show.mesh_sheet import shaded_picture
from rfgen_sionna.show.page import velocity_limit
from rfgen_sionna.show.picture_file import picture_file
from rfgen_sionna.show.run_view import FrameView, NoPictureError, RunView, display_range
from rfgen_sionna.show.style import INK, LEVEL_MAP, MUTED, VELOCITY_MAP, edges, level_limits
from rfgen_sionna.show.viewer_frames import viewed_frame, viewed_run

_TILE, _COLUMNS = 1.42, 2
"""Width and height of a picture [inch]; recordings side by side."""
_TITLES = ("mesh or joints", "range–Doppler", "micro-Doppler", "points from above")
"""What the four pictures show."""
_BODY = (0.72, 0.76, 0.81)
"""Red, green and blue of meshes, 0 … 1."""
_ASIDE_DEG = 25.0
"""Of the eye from the radar's direction, towards the right of those who face it [degrees]."""
_DPI = 110
"""Pixels per inch."""
_CAPTION = 96
"""Letters of a caption."""


def draw_dataset_sheet(
    folder: str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    count: int = 24,
    seed: int = 0,
    overwrite: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Contact sheet of a data set: `count` recordings over its splits, places and actions.

    Parameters
    ----------
    folder
        Folder of the set.
    output
        Picture file; its suffix selects the format (.png, .pdf …).
    count
        Recordings on the sheet; all of a smaller set.
    seed
        Seed of the choice.
    overwrite
        Whether an existing picture is replaced.
    progress
        Called with the number of finished recordings and of all; None calls nothing.

    Returns the path of the written file. Errors are those of :func:`~rfgen_sionna.show.sheet`; ValueError if `count` is
    not positive.
    """
    if count < 1:
        raise ValueError(f"count is {count}: at least one recording is needed")
    with picture_file(output, overwrite) as (made, form), open_dataset(folder) as recordings:
        rows = recordings.rows
        kinds = [(row.split, row.place, row.actions) for row in rows]
        runs = {}
        for index in spread_sample(kinds, count, seed):
            row = rows[index]
            distance = "" if row.distance_m is None else f" · {row.distance_m:.1f} m"
            actions = ", ".join(dict.fromkeys(row.actions))
            runs[f"{row.number:06d} · {row.split} · {actions} · {row.place}{distance}"] = recordings[index]
        _draw(runs, progress).savefig(made, dpi=_DPI, format=form)
    return Path(output)


def spread_sample(kinds: Sequence[Sequence[Hashable]], count: int, seed: int) -> list[int]:
    """Indices of `count` things, ascending, over all values of each of their properties.

    `kinds` has the properties of each thing. One after the other, the thing is taken whose values have been taken
    least; `seed` orders equals.
    """
    left = [int(index) for index in np.random.default_rng(seed).permutation(len(kinds))]
    taken: Counter[tuple[int, Hashable]] = Counter()
    chosen: list[int] = []
    while left and len(chosen) < count:
        best = min(left, key=lambda index: sum(taken[each] for each in enumerate(kinds[index])))
        left.remove(best)
        taken.update(enumerate(kinds[best]))
        chosen.append(best)
    return sorted(chosen)


def contact_sheet(
    runs: Mapping[str, Displayable | str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    dpi: int = _DPI,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Four pictures of each of the `runs` (caption and open run, or its path): mesh or joints as seen from the radar's
    side, range-Doppler map of the frame with the fastest motion, Doppler over time, and moving points from above.

    Of a run of several radars the first is drawn. What a recording does not store stays empty. Errors are those of
    :func:`draw_dataset_sheet`.
    """
    with picture_file(output, overwrite) as (made, form):
        _draw(runs, progress).savefig(made, dpi=dpi, format=form)
    return Path(output)


def _draw(
    runs: Mapping[str, Displayable | str | os.PathLike[str]], progress: Callable[[int, int], None] | None
) -> Figure:
    if not runs:
        raise ValueError("there are no recordings to draw")
    columns = min(_COLUMNS, len(runs))
    rows = -(-len(runs) // columns)
    width, height = 4 * _TILE + 0.75, _TILE + 0.5
    figure = Figure((columns * width, rows * height + 0.1), facecolor="white")
    for number, (caption, run) in enumerate(runs.items()):
        row, column = divmod(number, columns)
        left, bottom = column * width + 0.1, (rows - 1 - row) * height + 0.22
        tiles = [
            figure.add_axes(_share(figure, left + k * (_TILE + 0.18) + (0.08 if k else 0), bottom, _TILE, _TILE))
            for k in range(4)
        ]
        place = _share(figure, left, bottom + _TILE + 0.09, 0, 0)
        figure.text(place[0], place[1], _shortened(caption), fontsize=7, color=INK, fontweight="bold", va="bottom")
        if isinstance(run, str | os.PathLike):
            with open_run(run) as own:
                _draw_run(tiles, own, first=row == 0)
        else:
            _draw_run(tiles, run, first=row == 0)
        if progress is not None:
            progress(number + 1, len(runs))
    return figure


def _share(
    figure: Figure, left: float, bottom: float, width: float, height: float
) -> tuple[float, float, float, float]:
    """Rectangle [inch] as shares of the figure."""
    across, up = figure.get_size_inches()
    return left / across, bottom / up, width / across, height / up


def _shortened(text: str) -> str:
    flat = " ".join(text.replace("$", r"\$").split())
    return flat if len(flat) <= _CAPTION else f"{flat[: _CAPTION - 1]}…"


def _draw_run(tiles: Sequence[Axes], source: Displayable, *, first: bool) -> None:
    """Four pictures of a run, with titles where it stands `first`."""
    run = next(iter(source.radars.values())) if isinstance(source, Run) else source
    for axes, title in zip(tiles, _TITLES, strict=True):
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_facecolor("#eef1f4")
        for spine in axes.spines.values():
            spine.set_visible(False)
        if first:
            axes.set_xlabel(title, fontsize=6, color=MUTED, labelpad=9)
            axes.xaxis.set_label_coords(0.5, -0.09)
    shapes = actor_shapes(run)
    try:
        whole = viewed_run(run)
        view = viewed_frame(run, whole.most_active_frame)
    except NoPictureError as reason:
        tiles[1].text(0.5, 0.5, "no ranges", transform=tiles[1].transAxes, ha="center", fontsize=7, color=MUTED)
        tiles[1].set_gid(str(reason))
        _draw_shapes(tiles[0], run, shapes, 0)
        return
    _draw_shapes(tiles[0], run, shapes, whole.most_active_frame)
    far = max(display_range(run, frame, shapes) for frame in (0, len(run) - 1))
    if view.range_doppler.size:
        _draw_range_doppler(tiles[1], view, far)
    if whole.doppler_time.power.size:
        _draw_doppler_time(tiles[2], whole)
    _draw_points(tiles[3], run, view, shapes, whole.most_active_frame, far)


def _draw_shapes(axes: Axes, run: Displayable, shapes: Sequence[ActorShape], frame: int) -> None:
    """Meshes seen from the radar's side and above, or the joints where there are none."""
    meshes = [(shape, shape.mesh(frame)) for shape in shapes if len(shape.faces)]
    here = np.asarray(run.radar.position)
    if meshes:
        points = np.concatenate([points for _, points in meshes]).astype(np.float64)
        starts = np.cumsum([0, *(len(each) for _, each in meshes)])
        faces = np.concatenate([shape.faces + start for (shape, _), start in zip(meshes, starts, strict=False)])
        toward = here - points.mean(axis=0)
        turn = np.arctan2(toward[1], toward[0])  # the radar's side becomes +x, from which the light comes
        c, s = np.cos(turn), np.sin(turn)
        turned = points @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        picture = shaded_picture(turned, faces, np.tile(_BODY, (len(faces), 1)), _ASIDE_DEG)
        axes.imshow(picture, interpolation="antialiased")
        return
    joints = [(shape, shape.joints(frame)) for shape in shapes]
    left = run.radar.rotation[:, 1]
    for shape, places in joints:
        across = -(places - here) @ left
        for parent, child in shape.bones:
            axes.plot(across[[parent, child]], places[[parent, child], 2], color=INK, linewidth=0.8)
        axes.scatter(across, places[:, 2], s=0.8, color=INK)
    axes.set_aspect("equal", adjustable="datalim")


def _draw_range_doppler(axes: Axes, view: FrameView, far: float) -> None:
    rows = view.range <= far
    low, high = level_limits(view.range_doppler[rows])
    axes.pcolormesh(
        edges(view.velocity), edges(view.range[rows]), view.range_doppler[rows], cmap=LEVEL_MAP, vmin=low, vmax=high,
        rasterized=True,
    )  # fmt: skip
    _ends(axes, (view.velocity[0], view.velocity[-1]), (0.0, far), ("m/s", "m"))


def _draw_doppler_time(axes: Axes, whole: RunView) -> None:
    spectrum = whole.doppler_time
    level = watts_to_dbm(spectrum.power.T)
    low, high = level_limits(level, 45.0)
    axes.pcolormesh(
        edges(spectrum.time), edges(spectrum.velocity), level, cmap=LEVEL_MAP, vmin=low, vmax=high, rasterized=True
    )
    borders = edges(spectrum.time)
    _ends(axes, (borders[0], borders[-1]), (spectrum.velocity[0], spectrum.velocity[-1]), ("s", "m/s"))


def _draw_points(
    axes: Axes, run: Displayable, view: FrameView, shapes: Sequence[ActorShape], frame: int, far: float
) -> None:
    """Moving points in the radar's frame from above, ahead is up and left on the left, over the actors."""
    radar = run.radar
    for shape in shapes:
        around: FloatArray = (shape.points(frame) - np.asarray(radar.position)) @ radar.rotation
        axes.scatter(around[::7, 1], around[::7, 0], s=1.0, color="#c3cad2", linewidths=0)
    cloud = view.cloud
    speed = velocity_limit(cloud.velocity)
    axes.scatter(
        cloud.device[:, 1], cloud.device[:, 0], s=7, c=cloud.velocity, cmap=VELOCITY_MAP,
        norm=Normalize(-speed, speed), edgecolors=INK, linewidths=0.3,
    )  # fmt: skip
    axes.scatter([0], [0], s=12, marker="s", color=INK)
    axes.set_aspect("equal")
    _ends(axes, (far / 2, -far / 2), (-0.04 * far, 0.96 * far), ("m", "m"), MUTED)


def _ends(axes: Axes, x: Sequence[float], y: Sequence[float], units: tuple[str, str], ink: str = "white") -> None:
    """Limits of the axes, with their ends as text: of x below the picture, the last of y in `ink` within it."""
    axes.set_xlim(x[0], x[1])
    axes.set_ylim(y[0], y[1])
    first, last, top = (f"{round(float(value), 1) + 0.0:.2g}".replace("-", "−") for value in (*x, y[1]))
    for text, place, side, colour in (
        (first, (0.0, -0.02), "left", MUTED),
        (f"{last} {units[0]}", (1.0, -0.02), "right", MUTED),
        (f"{top} {units[1]}", (0.02, 0.98), "left", ink),
    ):
        axes.text(*place, text, transform=axes.transAxes, fontsize=5.5, color=colour, ha=side, va="top")
