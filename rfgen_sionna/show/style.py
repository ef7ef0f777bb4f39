"""Colours, axes and scales of the figures. They are made without pyplot, so that nothing global changes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from rfgen_sionna._types import FloatArray

INK = "#1d2733"
MUTED = "#6b7785"

LEVEL_MAP = "inferno"
DELAY_MAP = "viridis_r"
VELOCITY_MAP = "coolwarm"
"""Blue approaches, red recedes."""


def titled(axes: Axes, title: str, note: str = "") -> None:
    """Bold title on the left, muted note on the right."""
    axes.set_title(title, loc="left", fontsize=10.5, fontweight="bold", color=INK, pad=6)
    if note:
        axes.set_title(note, loc="right", fontsize=8, color=MUTED, pad=6)


def plain(axes: Axes, x: str, y: str) -> None:
    """Axis labels, small ticks, thin frame."""
    axes.set_xlabel(x, fontsize=9, color=INK, labelpad=2)
    axes.set_ylabel(y, fontsize=9, color=INK, labelpad=2)
    axes.tick_params(labelsize=8, colors=INK, width=0.6, length=3)
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)
        spine.set_color(MUTED)


def scale(figure: Figure, drawn: AxesImage | Collection, axes: Axes, label: str) -> None:
    """Narrow colour bar with a label, as high as the picture."""
    bar = figure.colorbar(drawn, cax=axes.inset_axes((1.015, 0.0, 0.025, 1.0)))
    bar.set_label(label, fontsize=8, color=INK)
    bar.ax.tick_params(labelsize=7.5, colors=INK, width=0.5, length=2.5)
    bar.outline.set_linewidth(0.5)


def level_limits(level: FloatArray, span: float = 60.0, margin: float = 3.0) -> tuple[float, float]:
    """Colour limits [dB] of a map: from `margin` below its median, at most `span` below the peak, to the peak.

    They span at least 20 dB, so that noise alone stays dark.
    """
    finite = level[np.isfinite(level)]
    if finite.size == 0:
        return -20.0, 0.0
    top = float(np.ceil(finite.max()))
    low = max(float(np.median(finite)) - margin, top - span)
    return min(low, top - 20.0), top


def edges(centres: FloatArray) -> FloatArray:
    """(n + 1,) cell borders halfway between `centres` (n,)."""
    if len(centres) == 1:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    inner = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - inner[0]], inner, [2 * centres[-1] - inner[-1]]])
