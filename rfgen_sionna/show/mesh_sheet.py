"""Sheet of shaded meshes: one picture for each actor, at one time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.show.style import INK, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS: Mapping[str, tuple[float, float, float]] = {
    "metal": (0.52, 0.58, 0.66), "glass": (0.66, 0.82, 0.92), "rubber": (0.20, 0.20, 0.22),
    "plastic": (0.86, 0.86, 0.84), "skin": (0.66, 0.50, 0.38), "clothing": (0.36, 0.48, 0.64),
    "wood": (0.74, 0.58, 0.40), "leather": (0.36, 0.24, 0.18),
}  # fmt: skip
"""Red, green, blue of materials, 0 … 1."""
_OTHER = (0.6, 0.6, 0.6)
_COLUMNS = 5
_LIGHT = np.array([0.45, -0.35, 0.82])
_ELEVATION = np.radians(18.0)
"""Of the eye [rad]."""
_PIXELS = 400
"""Rows and columns of the depth buffer, of which four make a pixel."""
_MARGIN = 1.05
"""Size of a field over that of what it shows."""
_BARS = [step * 10.0**power for power in range(-3, 3) for step in (1, 2, 5)]
"""Lengths of bars [m]."""


def draw_mesh_sheet(
    actors: Mapping[str, MeshActor], path: Path, *, time: float = 0.0, azimuth_deg: float = 35.0, dpi: int = 90
) -> None:
    """Write a picture (PNG, PDF or SVG) of actors from ahead and above, each in a field of its own with its size
    and a bar of a round length.

    Args:
        actors: caption and actor.
        path: file to write.
        time: [s]
        azimuth_deg: direction of the eye from the front, towards the actor's right [degrees].
        dpi: pixels per inch.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(_COLUMNS, len(actors))
    rows = -(-len(actors) // columns)
    figure = Figure((2.1 * columns, 2.2 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.ravel():
        axes.set_axis_off()
    for axes, (label, actor) in zip(grid.ravel(), actors.items(), strict=False):
        size = _draw(axes, actor, time, azimuth_deg)
        axes.set_title(label, fontsize=9, color=INK, pad=2)
        text = " × ".join(f"{length:.2g}" for length in size)
        axes.text(0.5, -0.06, f"{text} m", transform=axes.transAxes, ha="center", va="top", fontsize=7, color=MUTED)
    figure.savefig(path, dpi=dpi)


def _draw(axes: Axes, actor: MeshActor, time: float, azimuth_deg: float) -> FloatArray:
    """Draw an actor in its own frame; its length, width and height [m]."""
    points = actor.sequence.vertices(time)
    colours = np.array([COLOURS.get(each.name, _OTHER) for each in actor.materials])[actor.face_parts]
    axes.imshow(shaded_picture(points, actor.sequence.faces, colours, azimuth_deg), interpolation="antialiased")
    metre = 0.5 * _PIXELS / (_MARGIN * _extent(points @ _view(azimuth_deg).T))
    length = max(each for each in _BARS if each * metre < 0.4 * 0.5 * _PIXELS)
    axes.plot([0, length * metre], [0.52 * _PIXELS] * 2, color=INK, linewidth=1.5, solid_capstyle="butt", clip_on=False)
    axes.text(length * metre + 4, 0.52 * _PIXELS, f"{length:g} m", ha="left", va="center", fontsize=6, color=INK)
    return np.asarray(np.ptp(points, axis=0))


def _view(azimuth_deg: float) -> FloatArray:
    """(3, 3) directions to the right, up and towards the eye, as rows."""
    c, s = np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg))
    low, high = np.cos(_ELEVATION), np.sin(_ELEVATION)
    eye, right = np.array([c * low, -s * low, high]), np.array([s, c, 0.0])
    return np.stack([right, np.cross(eye, right), eye])


def _extent(seen: FloatArray) -> float:
    """Greater of the width and the height of seen points (vertex, 3) [m]."""
    return float(np.ptp(seen[:, :2], axis=0).max())


def shaded_picture(points: FloatArray, faces: IntArray, colours: FloatArray, azimuth_deg: float) -> FloatArray:
    """(row, column, 4) picture of a mesh by a depth buffer, seen from ahead and above.

    Args:
        points: (vertex, 3) [m].
        faces: (face, 3) vertex indices.
        colours: (face, 3) red, green, blue, 0 … 1.
        azimuth_deg: direction of the eye from +x, towards -y [degrees].
    """
    view = _view(azimuth_deg)
    seen = points @ view.T
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    seen = (seen - middle) * _PIXELS / (_MARGIN * _extent(seen))
    corners = seen[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    ahead = np.flatnonzero(normal[:, 2] > 1e-9)
    normal = normal[ahead] / np.linalg.norm(normal[ahead], axis=1, keepdims=True)
    shade = 0.35 + 0.65 * np.clip(normal @ (view @ _LIGHT) / np.linalg.norm(_LIGHT), 0.0, 1.0)
    shaded = np.clip(colours[ahead] * shade[:, None], 0.0, 1.0)
    places, owners = _filled(corners[ahead])
    column, row = ((sign * places[:, k] + 0.5 * _PIXELS).astype(int) for k, sign in ((0, 1.0), (1, -1.0)))
    order = np.argsort(places[:, 2])  # the nearest is written last
    picture = np.zeros((_PIXELS, _PIXELS, 4))
    picture[row[order], column[order], :3] = shaded[owners[order]]
    picture[row, column, 3] = 1.0
    return picture.reshape(_PIXELS // 2, 2, _PIXELS // 2, 2, 4).mean(axis=(1, 3))


def _filled(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """(point, 3) points less than a pixel apart on triangles (face, 3, 3), and the face of each."""
    edges = np.linalg.norm((np.roll(corners, -1, axis=1) - corners)[..., :2], axis=2)
    first = edges.argmax(axis=1)
    turned = np.take_along_axis(corners, ((first[:, None] + np.arange(3)) % 3)[..., None], axis=1)
    longest = edges.max(axis=1)
    flat = turned[..., :2]
    (ax, ay), (bx, by) = (np.moveaxis(flat[:, k] - flat[:, 0], 1, 0) for k in (1, 2))
    height = np.abs(ax * by - ay * bx) / np.maximum(longest, 1e-9)
    steps = 2 ** np.ceil(np.log2(np.maximum(1.5 * np.stack([longest, height], axis=1), 1.0))).astype(int)
    points, owners = [], []
    for along, across in np.unique(steps, axis=0):
        own = np.flatnonzero((steps == (along, across)).all(axis=1))
        u, v = (((np.arange(n) + 0.5) / n) for n in (along, across))
        a, b, c = (turned[own, k][:, None, None] for k in range(3))
        base = a + u[:, None, None] * (b - a)
        points.append(((1.0 - v[:, None]) * base + v[:, None] * c).reshape(-1, 3))
        owners.append(np.repeat(own, along * across))
    return np.concatenate(points), np.concatenate(owners)
