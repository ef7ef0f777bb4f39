"""Sheet of shaded meshes: one picture for each actor, at one time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray
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
_FINEST = 1.0 / 40.0
"""Longest edge of drawn faces, as a share of the extent: faces are drawn from the farthest to the nearest."""


def draw_mesh_sheet(
    actors: Mapping[str, MeshActor], path: Path, *, time: float = 0.0, azimuth_deg: float = 35.0, dpi: int = 90
) -> None:
    """Write a picture (PNG, PDF or SVG) of actors from ahead and above, each in a field of its own with its size.

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
        axes.text(0.5, -0.02, f"{text} m", transform=axes.transAxes, ha="center", va="top", fontsize=7, color=MUTED)
    figure.savefig(path, dpi=dpi)


def _draw(axes: Axes, actor: MeshActor, time: float, azimuth_deg: float) -> FloatArray:
    """Draw an actor in its own frame; its length, width and height [m]."""
    import trimesh
    from matplotlib.collections import PolyCollection

    points, faces = actor.sequence.vertices(time), actor.sequence.faces
    size: FloatArray = np.ptp(points, axis=0)
    points, faces, source = trimesh.remesh.subdivide_to_size(
        points, faces, _FINEST * float(size.max()), max_iter=12, return_index=True
    )
    colours = np.array([COLOURS.get(each.name, _OTHER) for each in actor.materials])[actor.face_parts[source]]
    c, s = np.cos(np.radians(azimuth_deg)), np.sin(np.radians(azimuth_deg))
    low, high = np.cos(np.radians(18.0)), np.sin(np.radians(18.0))
    eye = np.array([c * low, -s * low, high])
    right = np.array([s, c, 0.0])
    up = np.cross(eye, right)
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(length, 1e-15)[:, None]
    seen = (normal @ eye > 0.0) & (length > 0.0)
    order = np.flatnonzero(seen)[np.argsort((corners[seen] @ eye).mean(axis=1))]
    shade = 0.35 + 0.65 * np.clip(normal @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    flat = np.stack([corners @ right, corners @ up], axis=-1)[order]
    drawn = np.clip(colours * shade[:, None], 0.0, 1.0)[order]
    axes.add_collection(
        PolyCollection(list(flat), facecolors=drawn, edgecolors=drawn, linewidths=0.3, rasterized=True)  # type: ignore[arg-type]
    )
    middle = 0.5 * (flat.min(axis=(0, 1)) + flat.max(axis=(0, 1)))
    half = 0.53 * float(np.ptp(flat, axis=(0, 1)).max())
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    return size
