"""Viewer of a run in Rerun: scene, maps, spectrogram, labels on one time line."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from rfgen_sionna.dataset import Run
from rfgen_sionna.show.displayable import CapturedRun, Displayable, displayed
from rfgen_sionna.show.level_pictures import coloured
from rfgen_sionna.show.page_data import PageData, Progress, page_data
from rfgen_sionna.show.picture_file import picture_file
from rfgen_sionna.show.run_summary import summary
from rfgen_sionna.show.style import VELOCITY_MAP
from rfgen_sionna.signal.formats import Capture

if TYPE_CHECKING:
    import rerun

TIME, FRAME = "time", "frame"
"""Time lines: start of the frame [s], number of the frame."""
_AXES = np.eye(3)
_AXIS_COLOURS = [[208, 64, 64], [47, 158, 68], [48, 96, 208]]
"""Red, green and blue of the arrows along x, y and z."""
_BODY, _BONE = [184, 194, 207], [122, 79, 181]
"""Red, green and blue of meshes and of joints."""
_ACCENT = [25, 195, 214]
"""Red, green and blue of the radar's boresight and of labels over spectra."""
_TICK = [120, 130, 140]
"""Red, green and blue of values along axes."""
_ASPECT = 2.2
"""Width over height of pictures over time, whose cells are repeated."""


def open_in_rerun(
    run: Run | Capture | str | os.PathLike[str],
    *,
    save: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path | None:
    """Open a run in Rerun: mesh or joints, point cloud and radar in the world frame, PIR, range-Doppler map,
    spectrogram and labels on the time line "time" [s].

    Parameters
    ----------
    run
        An open run of one radar, an open capture, or the path of a run.
    save
        File to write instead of opening a window: .rrd, for `rerun file.rrd`.
    overwrite
        Whether an existing file is replaced.
    progress
        Called with the number of finished frames and of all frames; None calls nothing.

    Returns
    -------
    Path of the written file, or None with a window.

    Raises
    ------
    ImportError
        If Rerun is not installed.
    OutputError
        If the file exists or its folder is missing or not writable.
    OSError
        If there is no display for a window.
    ValueError
        If `save` has another suffix.
    NoPictureError
        If the samples have no ranges.
    """
    stream = _stream()
    if save is None and sys.platform == "linux" and not (os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}):
        raise OSError(
            "there is no display for Rerun's window: save a file (--save run.rrd) and open it where there is one, "
            "or write a page (rfgen show --html run.html)"
        )
    file: AbstractContextManager[Any] = nullcontext()
    if save is not None:
        file = picture_file(save, overwrite, (".rrd",))
    with file as written, displayed(run) as source:
        report = summary(source.capture if isinstance(source, CapturedRun) else source)  # type: ignore[arg-type]
        data, layout = page_data(source, report, progress, len(source)), _layout(source)
        if written is None:
            stream.spawn(default_blueprint=layout)
            _log(stream, source, data)
            stream.flush()
        else:
            stream.save(written[0], default_blueprint=layout)
            _log(stream, source, data)
            stream.disconnect()
    return None if save is None else Path(save)


def _stream() -> rerun.RecordingStream:
    try:
        import rerun
    except ImportError as error:
        raise ImportError(
            "Rerun is not installed: pip install 'rfgen-sionna[view]', or write a page (rfgen show --html run.html)"
        ) from error
    return rerun.RecordingStream("rfgen")


def _layout(run: Displayable) -> Any:
    """Views: the scene, the maps and the texts, and below them what goes over time."""
    import rerun.blueprint as rrb

    maps: list[Any] = [rrb.Spatial2DView(origin="range_doppler", name="Range [m] over radial velocity [m/s]")]
    if run.has_pir:
        names = {"energy": "PIR energy", "time_of_arrival": "Time of arrival", "velocity": "Velocity"}
        maps.append(rrb.Tabs(*(rrb.Spatial2DView(origin=f"pir/{key}", name=name) for key, name in names.items())))
    texts = rrb.Tabs(
        rrb.TextDocumentView(origin="texts/labels", name="Labels"),
        rrb.TextDocumentView(origin="texts/report", name="Report"),
    )
    scene = rrb.Spatial3DView(origin="world", name="Scene")
    over_time = [
        rrb.Spatial2DView(origin="doppler_time", name="Radial velocity [m/s] over time [s]"),
        rrb.Spatial2DView(origin="range_time", name="Range [m] over time [s]"),
        rrb.TimeSeriesView(
            origin="labels",
            contents=["/labels/distance/**", "/labels/radial_velocity/**"],
            name="Labels: distance [m], radial velocity [m/s]",
        ),
    ]
    upper = rrb.Horizontal(scene, rrb.Vertical(*maps), texts, column_shares=[3, 2, 1.4])
    return rrb.Blueprint(rrb.Vertical(upper, rrb.Horizontal(*over_time), row_shares=[2.2, 1]), collapse_panels=True)


def _log(stream: rerun.RecordingStream, run: Displayable, data: PageData) -> None:
    """Log a run: what does not move once, the rest in each frame."""
    import rerun

    header, arrays = data.header, data.arrays
    low, high = np.array(header["low"]), np.array(header["high"])
    places = {
        name: (low + array / 65535.0 * (high - low)).astype(np.float32)
        for name, array in arrays.items()
        if name.endswith((".mesh", ".joints"))
    }
    text = "\n\n".join(header[name] for name in ("title", "conventions", "report"))
    stream.log("texts/report", rerun.TextDocument(text), static=True)
    _log_world(stream, run)
    pictures = [plot for plot in (header["rangeDoppler"], *header["pir"]) if plot]
    for plot in (*pictures, *header["spectrograms"]):
        _log_axes(stream, plot, arrays[plot["array"]].shape)
    for plot in header["spectrograms"]:
        stream.log(plot["array"], rerun.Image(_enlarged(plot, arrays[plot["array"]])), static=True)
    for frame, time in enumerate(header["times"]):
        stream.set_time(TIME, duration=time)
        stream.set_time(FRAME, sequence=frame)
        for actor in header["actors"]:
            _log_actor(stream, actor["name"], actor["array"], frame, places, arrays)
        _log_cloud(
            stream, arrays["cloud"][slice(*header["cloud"]["starts"][frame : frame + 2])], header["cloud"]["speed"]
        )
        for plot in pictures:
            stream.log(plot["array"], rerun.Image(coloured(arrays[plot["array"]][frame], plot["map"])))
        for plot in header["spectrograms"]:
            _log_cursor(stream, plot, arrays[plot["array"]].shape, time)
        _log_labels(stream, run, header["labels"], frame)


def _log_world(stream: rerun.RecordingStream, run: Displayable) -> None:
    """Axes, and the radar with its pose: its frame has x along the boresight, y to the left, z up."""
    import rerun

    radar = run.radar
    stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    arrows = rerun.Arrows3D(vectors=0.5 * _AXES, colors=_AXIS_COLOURS, labels=["x", "y", "z"])
    stream.log("world/axes", arrows, static=True)
    pose = rerun.Transform3D(translation=np.asarray(radar.position, float), mat3x3=radar.rotation)
    stream.log("world/radar", pose, static=True)
    box = rerun.Boxes3D(half_sizes=[[0.01, 0.05, 0.05]], colors=[[29, 39, 51]], labels=[radar.name])
    stream.log("world/radar/case", box, static=True)
    boresight = rerun.Arrows3D(vectors=[[0.5, 0.0, 0.0]], colors=[_ACCENT], labels=["boresight"])
    stream.log("world/radar/boresight", boresight, static=True)


def _log_actor(
    stream: rerun.RecordingStream,
    name: str,
    array: str,
    frame: int,
    places: dict[str, NDArray[np.float32]],
    arrays: dict[str, NDArray[Any]],
) -> None:
    import rerun

    points, joints = places[f"{array}.mesh"][frame], places[f"{array}.joints"][frame]
    faces, bones = arrays[f"{array}.faces"].astype(np.uint32), arrays[f"{array}.bones"]
    path: list[object] = ["world", "actors", name]
    if len(points):
        mesh = rerun.Mesh3D(
            vertex_positions=points, triangle_indices=faces, vertex_normals=_normals(points, faces), albedo_factor=_BODY
        )
        stream.log([*path, "mesh"], mesh)
    if len(joints):
        stream.log([*path, "joints"], rerun.Points3D(joints, radii=0.012, colors=[_BONE]))
        stream.log([*path, "bones"], rerun.LineStrips3D(joints[bones], radii=0.006, colors=[_BONE]))


def _normals(points: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    """(point, 3) unit normals: means of the faces' around each point, by area."""
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(points)
    for corner in range(3):
        np.add.at(total, faces[:, corner], normal)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12), np.float32)


def _log_cloud(stream: rerun.RecordingStream, cloud: NDArray[np.float32], speed: float) -> None:
    """Points (point, 5): position, radial velocity, SNR. Colours are velocities up to ±`speed` [m/s], sizes the SNR."""
    import rerun

    colours = colormaps[VELOCITY_MAP](np.clip(cloud[:, 3] / speed, -1, 1) / 2 + 0.5)[:, :3]
    radii = 0.015 + 0.0008 * np.clip(cloud[:, 4] - 10, 0, 30)
    stream.log("world/point_cloud", rerun.Points3D(cloud[:, :3], colors=colours, radii=radii))


def _repeats(plot: dict[str, Any], shape: tuple[int, ...]) -> tuple[int, int]:
    """How often rows and columns of a picture (frame, row, column) are repeated."""
    if not plot["xLabel"].startswith("time"):
        return 1, 1
    ratio = _ASPECT * shape[1] / shape[2]
    return max(1, round(1 / ratio)), max(1, round(ratio))


def _enlarged(plot: dict[str, Any], picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    rows, columns = _repeats(plot, picture.shape)
    return coloured(picture[0].repeat(rows, axis=0).repeat(columns, axis=1), plot["map"])


def _pixels(plot: dict[str, Any], shape: tuple[int, ...], x: Any, y: Any) -> NDArray[np.float64]:
    """(point, 2) column and row of values on the axes of a picture (frame, row, column)."""
    rows, columns = np.multiply(shape[1:], _repeats(plot, shape))
    (left, right), (bottom, top) = plot["x"], plot["y"]
    across = (np.asarray(x, float) - left) / (right - left) * columns
    down = (top - np.asarray(y, float)) / (top - bottom) * rows
    return np.stack(np.broadcast_arrays(across, down), axis=-1)


def _log_axes(stream: rerun.RecordingStream, plot: dict[str, Any], shape: tuple[int, ...]) -> None:
    """Values along the lower and the left border of a picture, and its label's curves."""
    import rerun

    (left, right), bottom = plot["x"], plot["y"][0]
    beside, (across, texts) = left - 0.03 * (right - left), _ticks(plot, plot["x"], 5)
    up, more = _ticks(plot, plot["y"], 3)
    places = [_pixels(plot, shape, across, bottom), _pixels(plot, shape, beside, up)]
    points = rerun.Points2D(np.concatenate(places), labels=texts + more, show_labels=True, colors=[_TICK], radii=-1.5)
    stream.log(f"{plot['array']}/axes", points, static=True)
    if line := plot.get("line"):
        curves = [
            _pixels(plot, shape, np.array(line["times"])[known], np.array(values, float)[known])
            for values in line["values"]
            if np.any(known := np.array([value is not None for value in values]))
        ]
        stream.log(f"{plot['array']}/label", rerun.LineStrips2D(curves, colors=[_ACCENT], radii=-1.0), static=True)


def _ticks(plot: dict[str, Any], ends: Sequence[float], most: int) -> tuple[NDArray[np.float64], list[str]]:
    """Round values between the ends of an axis, and their texts; of a perspective image in degrees."""
    tangent = plot.get("tangent", False)
    low, high = np.sort(np.degrees(np.arctan(ends)) if tangent else np.asarray(ends))
    ticks = np.asarray(MaxNLocator(most).tick_values(low, high))
    ticks = ticks[(ticks >= low) & (ticks <= high)]
    return np.asarray(np.tan(np.radians(ticks)) if tangent else ticks), [
        f"{tick:g}".replace("-", "−") for tick in ticks
    ]


def _log_cursor(stream: rerun.RecordingStream, plot: dict[str, Any], shape: tuple[int, ...], time: float) -> None:
    import rerun

    line = _pixels(plot, shape, time, plot["y"])
    stream.log(f"{plot['array']}/now", rerun.LineStrips2D([line], colors=[[255, 255, 255]], radii=-1.0))


def _log_labels(stream: rerun.RecordingStream, run: Displayable, rows: list[dict[str, Any]], frame: int) -> None:
    """All labels as text, and those with one number an actor as curves."""
    import rerun

    several = len(run.actors) > 1
    lines = [
        f"{row['actor'] + ' ' if several else ''}{row['name']}: {row['texts'][frame]} {row['unit']}".strip()
        for row in rows
        if row["texts"][frame] != "–"
    ]
    stream.log("texts/labels", rerun.TextDocument("\n".join(lines) or "no labels"))
    for name, label in run.labels.items():
        if label.dims == ("frame", "actor") and label.values.dtype.kind == "f":
            for actor, value in zip(run.actors, label.values[frame], strict=True):
                if np.isfinite(value):
                    stream.log(["labels", name, actor], rerun.Scalars(float(value)))
