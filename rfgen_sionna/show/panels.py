"""Panels of a sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.spectrum import decibel, watts_to_dbm
from rfgen_sionna.records import Pir
from rfgen_sionna.show.displayable import Displayable
from rfgen_sionna.show.run_view import FrameView, RunView
from rfgen_sionna.show.style import DELAY_MAP, LEVEL_MAP, VELOCITY_MAP, edges, level_limits, plain, scale, titled

ACCENT = "#19c3d6"
"""Colour of ground truth over a spectrum."""


def draw_pir(figure: Figure, axes: Sequence[Axes], pir: Pir) -> None:
    """Energy, time of arrival and velocity images, left and up as seen from the radar."""
    there = pir.energy > 0
    energy = np.where(there, decibel(np.where(there, pir.energy, 1.0)), np.nan)
    low, high = level_limits(energy, 60.0, margin=15.0)
    limit = symmetric_limit(pir.velocity[there])
    pictures = (
        ("PIR energy", "|path gain|² [dB]", energy, LEVEL_MAP, low, high),
        ("PIR time of arrival", "round trip [ns]", pir.time_of_arrival * 1e9, DELAY_MAP, None, None),
        ("PIR velocity", "radial velocity [m/s]", np.where(there, pir.velocity, np.nan), VELOCITY_MAP, -limit, limit),
    )
    flat = pir.projection == "perspective"
    half = [np.tan(np.radians(fov / 2)) if flat else fov / 2 for fov in pir.fov_deg]
    for place, (title, unit, image, colours, bottom, top) in zip(axes, pictures, strict=True):
        place.set_facecolor("#d9dee3")
        drawn = place.imshow(
            image, cmap=colours, vmin=bottom, vmax=top, extent=(half[0], -half[0], -half[1], half[1]),
            interpolation="nearest", aspect="equal",
        )  # fmt: skip
        titled(place, title)
        plain(place, "azimuth [°]", "elevation [°]" if place is axes[0] else "")
        for axis, fov in ((place.xaxis, pir.fov_deg[0]), (place.yaxis, pir.fov_deg[1])):
            step = 10 if fov < 50 else 20 if fov < 100 else 30
            degrees = np.arange(-(fov / 2 // step) * step, fov / 2 + 1, step)
            axis.set_ticks(np.tan(np.radians(degrees)) if flat else degrees, [f"{d:.0f}" for d in degrees])
        scale(figure, drawn, place, unit)


def draw_range_doppler(figure: Figure, axes: Axes, view: FrameView, far: float, top: float | None = None) -> None:
    """Level over radial velocity and range up to `far` [m]; `top` fixes the upper end of the colours."""
    rows = view.range <= far
    level = view.range_doppler[rows]
    low, high = level_limits(level)
    high = high if top is None else top
    drawn = axes.pcolormesh(
        edges(view.velocity), edges(view.range[rows]), level, cmap=LEVEL_MAP, vmin=min(low, high - 20), vmax=high,
        rasterized=True,
    )  # fmt: skip
    titled(axes, "Range–Doppler", "static included" if view.static else "static removed")
    plain(axes, "radial velocity [m/s]   (+ receding)", "range [m]")
    axes.set_ylim(0, far)
    scale(figure, drawn, axes, f"mean channel power [{view.unit}]")


def draw_azimuth(figure: Figure, axes: Axes, view: FrameView, far: float) -> None:
    """Power over the floor, left on the left, up to `far` [m]; moving detections are marked."""
    azimuth, points = view.azimuth, view.cloud.device
    if azimuth is None:
        return
    rows = azimuth.range <= far
    level = watts_to_dbm(azimuth.power[rows])
    angle, distance = np.meshgrid(edges(azimuth.azimuth).clip(-np.pi / 2, np.pi / 2), edges(azimuth.range[rows]))
    low, high = level_limits(level, 50.0)
    drawn = axes.pcolormesh(
        distance * np.sin(angle), distance * np.cos(angle), level, cmap=LEVEL_MAP, vmin=low, vmax=high, rasterized=True
    )
    axes.set_facecolor("#000004")
    near = np.linalg.norm(points, axis=1) <= far
    if np.any(near):
        axes.scatter(
            points[near, 1], points[near, 0], s=14, facecolors="none", edgecolors=ACCENT, linewidths=0.6,
            label="moving detections",
        )  # fmt: skip
        axes.legend(loc="lower left", fontsize=7, frameon=False, labelcolor="white", handletextpad=0.2)
    titled(axes, "Azimuth map", "static included" if view.static else "static removed")
    plain(axes, "y [m]   (left is positive)", "x, boresight [m]")
    axes.set_aspect("equal")
    side = 0.8 * far
    axes.set_xlim(side, -side)
    axes.set_ylim(0, far)
    scale(figure, drawn, axes, f"beam power [{view.unit}]")


def draw_range_time(figure: Figure, axes: Axes, run: Displayable, view: RunView, far: float) -> None:
    """Moving part of the range profiles over time, up to `far` [m], with the labelled distances."""
    spectrum = view.range_time
    rows = spectrum.range <= far
    drawn = _over_time(axes, spectrum.time, spectrum.range[rows], watts_to_dbm(spectrum.power[:, rows].T))
    titled(axes, "Range–time", "static removed")
    plain(axes, "time [s]", "range [m]")
    axes.set_ylim(0, far)
    _truth(axes, run, "distance")
    scale(figure, drawn, axes, f"mean power [{view.unit}]")


def draw_doppler_time(figure: Figure, axes: Axes, run: Displayable, view: RunView) -> None:
    """Moving part of the Doppler spectra over time, with the labelled radial velocities."""
    spectrum = view.doppler_time
    drawn = _over_time(axes, spectrum.time, spectrum.velocity, watts_to_dbm(spectrum.power.T))
    span = f"{spectrum.duration * 1e3:.1f} ms"
    note = f"one spectrum a frame, {span} each" if view.per_frame else f"short-time transform, windows of {span}"
    titled(axes, "Doppler–time", f"{note}, static removed")
    plain(axes, "time [s]", "radial velocity [m/s]")
    _truth(axes, run, "radial_velocity")
    scale(figure, drawn, axes, f"power over all ranges [{view.unit}]")


def _over_time(axes: Axes, time: FloatArray, values: FloatArray, level: FloatArray) -> Collection:
    low, high = level_limits(level, 45.0)
    return axes.pcolormesh(edges(time), edges(values), level, cmap=LEVEL_MAP, vmin=low, vmax=high, rasterized=True)


def _truth(axes: Axes, run: Displayable, label: str) -> None:
    record = run.labels.get(label)
    if record is None or record.values.ndim != 2 or record.values.dtype.kind != "f":
        return
    for index, values in enumerate(record.values.T):
        name = f"label: {label.replace('_', ' ')}" if index == 0 else None
        axes.plot(run.mesh_times, values, color=ACCENT, linewidth=1.0, linestyle=(0, (5, 3)), label=name)
    axes.legend(loc="upper right", fontsize=7, frameon=False, labelcolor="white")


def symmetric_limit(velocity: FloatArray) -> float:
    """Limit [m/s] of nearly all velocities, rounded up to 0.5."""
    finite = np.abs(velocity[np.isfinite(velocity)])
    largest = float(np.quantile(finite, 0.999)) if finite.size else 0.0
    return max(0.5, np.ceil(2 * largest) / 2)
