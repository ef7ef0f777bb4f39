"""Contents of the viewer's page: texts and axes as JSON, arrays of bounded size as bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.spectrum import decibel, watts_to_dbm
from rfgen_sionna.show.actor_shapes import ActorShape, actor_shapes
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.show.level_pictures import MOST_COLUMNS, MOST_PIXELS, cell_span, even_columns, level_bytes, reduced
from rfgen_sionna.show.page import headline, velocity_limit
from rfgen_sionna.show.panels import symmetric_limit
from rfgen_sionna.show.run_summary import radar_line
from rfgen_sionna.show.run_view import FrameView, RunView, display_range
from rfgen_sionna.show.style import DELAY_MAP, LEVEL_MAP, VELOCITY_MAP, level_limits
from rfgen_sionna.show.viewer_frames import viewed_frame, viewed_run

Progress = Callable[[int, int], None]
Arrays = dict[str, NDArray[Any]]

MOST_FRAMES = 120
"""Frames on a page; a longer run shows every k-th one."""
MOST_LABEL_VALUES = 6
"""Values of a label a frame that are shown as text."""
CONVENTIONS = (
    "World: metres, right-handed, z up. Radial velocity: positive is receding. Azimuth: positive is left; elevation: "
    "positive is up, both in the radar's frame (x boresight, y left, z up)."
)
"""Axes and signs, as text for viewers."""


@dataclass(frozen=True)
class PageData:
    """Contents of a page."""

    header: dict[str, Any]
    """Texts, axes, and the names of arrays, ready for JSON."""
    arrays: Arrays
    """Arrays by name: uint8 pictures, uint16 positions as fractions of the limits, uint32 faces and
    bones, float32 points."""


def page_data(
    run: Displayable, report: str, progress: Progress | None = None, most_frames: int = MOST_FRAMES
) -> PageData:
    """Contents of the page of a run: at most `most_frames` frames, evenly spaced."""
    step = -(-len(run) // most_frames)
    frames = range(0, len(run), step)
    views = []
    for number, frame in enumerate(frames):
        views.append(viewed_frame(run, frame))
        if progress is not None:
            progress(number + 1, len(frames))
    whole, shapes = viewed_run(run), actor_shapes(run)
    far = max(display_range(run, frame, shapes) for frame in (0, len(run) - 1))
    tracks = [_Track.of(shape, frames) for shape in shapes]
    low, high = _limits(run, tracks)
    header: dict[str, Any] = {
        "title": headline(run),
        "radar": radar_line(run),
        "conventions": CONVENTIONS,
        "report": report,
        "frames": list(frames),
        "all": len(run),
        "times": run.frame_times[frames.start : frames.stop : step].tolist(),
        "low": low.tolist(),
        "high": high.tolist(),
        "place": list(map(float, run.radar.position)),
        "boresight": run.radar.rotation[:, 0].tolist(),
        "radarName": run.radar.name,
        "velocityMap": VELOCITY_MAP,
        "colours": {name: _colours(name) for name in (LEVEL_MAP, DELAY_MAP, VELOCITY_MAP)},
        "labels": _label_rows(run, frames),
    }
    arrays: Arrays = {}
    header["start"] = int(np.searchsorted(frames, whole.most_active_frame, side="right")) - 1
    header["actors"] = [_actor(track, low, high, arrays, f"actor{k}") for k, track in enumerate(tracks)]
    header["cloud"] = _cloud(views, arrays)
    header["rangeDoppler"] = _range_doppler(views, far, arrays) if views[0].range_doppler.size else None
    header["spectrograms"] = [
        *([_range_time(run, whole, far, arrays)] if whole.range_time.power.size else []),
        *([_doppler_time(run, whole, arrays)] if whole.doppler_time.power.size else []),
    ]
    header["pir"] = _pir(run, frames, arrays) if run.has_pir else []
    return PageData(header, arrays)


@dataclass(frozen=True)
class _Track:
    """Positions of an actor in all frames of a page [m]."""

    shape: ActorShape
    mesh: NDArray[np.float32]
    """(frame, point, 3)"""
    joints: NDArray[np.float32]
    """(frame, joint, 3)"""

    @classmethod
    def of(cls, shape: ActorShape, frames: Sequence[int]) -> _Track:
        return cls(shape, *(np.stack([read(frame) for frame in frames]) for read in (shape.mesh, shape.joints)))


def _limits(run: Displayable, tracks: Sequence[_Track]) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates [m] of the radar and the actors, with a margin."""
    places: list[NDArray[np.floating[Any]]] = [np.asarray(run.radar.position, np.float64)[None]]
    places += [each.reshape(-1, 3) for track in tracks for each in (track.mesh, track.joints) if each.size]
    if len(places) == 1:
        reach = run.radar.max_range / 2
        corners = reach * np.array([[1, y, z] for y in (-0.5, 0.5) for z in (-0.25, 0.25)])
        places.append(places[0] + corners @ run.radar.rotation.T)
    low = np.min([place.min(axis=0) for place in places], axis=0)
    high = np.max([place.max(axis=0) for place in places], axis=0) + 0.3
    floor = min(float(low[2]), 0.0) if tracks and low[2] < 0.6 else float(low[2]) - 0.3
    return np.array([low[0] - 0.3, low[1] - 0.3, floor]), high


def _actor(track: _Track, low: FloatArray, high: FloatArray, arrays: Arrays, name: str) -> dict[str, Any]:
    def fractions(points: NDArray[np.float32]) -> NDArray[np.uint16]:
        return np.rint((points - low) / (high - low) * 65535).clip(0, 65535).astype(np.uint16)

    shape = track.shape
    arrays[f"{name}.mesh"], arrays[f"{name}.joints"] = fractions(track.mesh), fractions(track.joints)
    arrays[f"{name}.faces"], arrays[f"{name}.bones"] = shape.faces.astype(np.uint32), shape.bones.astype(np.uint32)
    return {"name": shape.name, "material": shape.material, "array": name}


def _cloud(views: Sequence[FrameView], arrays: Arrays) -> dict[str, Any]:
    clouds = [view.cloud for view in views]
    rows = [np.column_stack([cloud.position, cloud.velocity, cloud.snr_db]) for cloud in clouds]
    arrays["cloud"] = np.concatenate(rows).astype(np.float32)
    starts = np.concatenate([[0], np.cumsum([len(cloud) for cloud in clouds])])
    return {"starts": starts.tolist(), "speed": velocity_limit(np.concatenate([cloud.velocity for cloud in clouds]))}


def _range_doppler(views: Sequence[FrameView], far: float, arrays: Arrays) -> dict[str, Any]:
    rows = views[0].range <= far
    level = np.stack([reduced(view.range_doppler[rows]) for view in views])
    low, high = level_limits(level)
    arrays["range_doppler"] = level_bytes(level[:, ::-1], low, high)
    note = "static included" if views[0].static else "static removed"
    return {
        "title": "Range–Doppler", "note": note, "array": "range_doppler", "map": LEVEL_MAP,
        "x": cell_span(views[0].velocity), "y": cell_span(views[0].range[rows]), "xLabel": "radial velocity [m/s]",
        "yLabel": "range [m]", "limits": [low, high], "unit": views[0].unit,
    }  # fmt: skip


def _range_time(run: Displayable, whole: RunView, far: float, arrays: Arrays) -> dict[str, Any]:
    spectrum = whole.range_time
    near = spectrum.range <= far
    picture = _over_time(spectrum.power[:, near], spectrum.time, whole, "range_time", arrays)
    limits = {"y": cell_span(spectrum.range[near]), "yLabel": "range [m]", "line": _truth(run, "distance")}
    return picture | limits | {"title": "Range–time", "note": "static included" if whole.static else "static removed"}


def _doppler_time(run: Displayable, whole: RunView, arrays: Arrays) -> dict[str, Any]:
    spectrum = whole.doppler_time
    picture = _over_time(spectrum.power, spectrum.time, whole, "doppler_time", arrays)
    truth = _truth(run, "radial_velocity")
    limits = {"y": cell_span(spectrum.velocity), "yLabel": "radial velocity [m/s]", "line": truth}
    note = f"{'one spectrum a frame' if whole.per_frame else 'short-time transform'}, static removed"
    return picture | limits | {"title": "Doppler–time", "note": note}


def _over_time(
    power: FloatArray, time: FloatArray, whole: RunView, name: str, arrays: dict[str, Any]
) -> dict[str, Any]:
    time, power = even_columns(time, power)
    level = reduced(watts_to_dbm(power.T), MOST_COLUMNS)
    low, high = level_limits(level, 45.0)
    arrays[name] = level_bytes(level[None, ::-1], low, high)
    return {
        "array": name, "map": LEVEL_MAP, "x": cell_span(time, MOST_COLUMNS, alone=0.1), "xLabel": "time [s]",
        "limits": [low, high], "unit": whole.unit,
    }  # fmt: skip


def _truth(run: Displayable, label: str) -> dict[str, Any] | None:
    record = run.labels.get(label)
    if record is None or record.values.ndim != 2 or record.values.dtype.kind != "f":
        return None
    values = [[None if not np.isfinite(x) else float(x) for x in row] for row in record.values.T]
    return {"name": f"label: {label.replace('_', ' ')}", "times": run.mesh_times.tolist(), "values": values}


def _pir(run: Displayable, frames: Sequence[int], arrays: Arrays) -> list[dict[str, Any]]:
    images = [run.pir(frame) for frame in frames]
    step = -(-max(images[0].energy.shape) // MOST_PIXELS)
    energy, delay, speed = (
        np.stack([getattr(image, name)[::step, ::step] for image in images])
        for name in ("energy", "time_of_arrival", "velocity")
    )
    there = energy > 0
    level = np.where(there, decibel(np.where(there, energy, 1.0)), np.nan)
    fastest = symmetric_limit(speed[there])
    finite = delay[np.isfinite(delay)] * 1e9
    near, far = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    flat = images[0].projection == "perspective"
    half = [float(np.tan(np.radians(fov / 2)) if flat else fov / 2) for fov in images[0].fov_deg]
    found = []
    for name, title, unit, image, colours, limits in (
        ("energy", "PIR energy", "dB", level, LEVEL_MAP, level_limits(level, 60.0, margin=15.0)),
        ("time_of_arrival", "PIR time of arrival", "ns", delay * 1e9, DELAY_MAP, (near, max(far, near + 1e-3))),
        ("velocity", "PIR velocity", "m/s", np.where(there, speed, np.nan), VELOCITY_MAP, (-fastest, fastest)),
    ):
        arrays[f"pir/{name}"] = level_bytes(image, *limits)
        found.append(
            {
                "title": title, "array": f"pir/{name}", "map": colours, "x": [half[0], -half[0]],
                "y": [-half[1], half[1]], "limits": list(map(float, limits)), "unit": unit, "tangent": flat,
                "xLabel": "azimuth [°]", "yLabel": "elevation [°]", "square": True, "empty": True,
            }
        )  # fmt: skip
    return found


def _label_rows(run: Displayable, frames: Sequence[int]) -> list[dict[str, Any]]:
    """Name, unit and text in each frame, of labels with few values."""
    rows = []
    for name, label in run.labels.items():
        if len(label.values) != len(run) or int(np.prod(label.values.shape[1:])) > MOST_LABEL_VALUES * len(run.actors):
            continue
        for number, actor in enumerate(run.actors if label.dims[1:2] == ("actor",) else [""]):
            values = label.values[:, number] if actor else label.values
            texts = [_label_text(values[frame]) for frame in frames]
            unit = "" if label.units in ("", "1") else label.units
            rows.append({"name": name.replace("_", " "), "actor": actor, "unit": unit, "texts": texts})
    return rows


def _label_text(value: Any) -> str:
    values = np.asarray(value)
    if values.dtype.kind in "OUS":
        return ", ".join(map(str, values.ravel()))
    values = values.astype(np.float64).ravel()
    if np.isnan(values).all():
        return "–"
    return ", ".join(
        "–" if np.isnan(x) else f"{x + 0.0:.3g}".replace("-", "−") for x in values.astype(np.float64).ravel()
    )


def _colours(name: str) -> list[int]:
    """(255 × 3) red, green and blue of a colour map, 0 … 255."""
    table: NDArray[Any] = colormaps[name](np.linspace(0, 1, 255))
    return [int(value) for value in (table[:, :3] * 255).round().ravel()]
