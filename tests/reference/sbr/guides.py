"""Where guiding rays may miss something small: tubes that hold it are divided until it is several tubes wide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.media import reflected_direction
from tests.reference.sbr import lattice
from tests.reference.sbr.hits import Hits
from tests.reference.sbr.skin import RaySkin

ACROSS = 4.0
"""Tubes across the middle extent of the smallest things, at first."""
FINEST = 11
"""Level beyond which nothing is looked for."""
MOST_BALLS = 400
"""Things that tubes from mirrors are held against one by one."""


@dataclass(frozen=True)
class Marks:
    """What tubes must not miss."""

    places: tuple[tuple[int, FloatArray], ...]
    """Levels, and directions (direction, 3) of corners in the lattice's frame around which tubes from the source are to
    be of that level at least."""
    centre: FloatArray
    """(ball, 3) balls around things [m], for tubes that come from elsewhere."""
    radius: FloatArray
    """(ball,) [m]"""
    size: FloatArray
    """(ball,) middle extent of what is in it [m]."""

    @staticmethod
    def of(skin: RaySkin, source: FloatArray, rotation: FloatArray, coarsest: int) -> Marks:
        """Of the sheets of a skin; tubes begin with the level `coarsest`."""
        offset = skin.corners - source
        distance = np.sqrt((offset**2).sum(axis=2))
        nearest = np.full(len(skin.plane), np.inf)
        np.minimum.at(nearest, skin.sheet, distance.min(axis=1))
        angle = np.maximum(skin.size, 1e-6) / np.maximum(nearest, 1e-3)
        level = np.ceil(np.log2(0.5 * np.pi * ACROSS / angle)).clip(0, FINEST).astype(int)[skin.sheet]
        small = np.flatnonzero(level > coarsest)
        towards = offset[small] @ rotation / np.maximum(distance[small], 1e-9)[..., None]
        places = tuple((int(each), towards[level[small] == each].reshape(-1, 3)) for each in np.unique(level[small]))
        low, high = (np.full((len(skin.plane), 3), sign * np.inf) for sign in (1, -1))
        for corner in range(3):
            np.minimum.at(low, skin.sheet, skin.corners[:, corner])
            np.maximum.at(high, skin.sheet, skin.corners[:, corner])
        widest = np.sort(np.argsort(-skin.size, kind="stable")[:MOST_BALLS])
        middle = 0.5 * (low + high)[widest]
        return Marks(places, middle, 0.5 * lengths(high - low)[widest], skin.size[widest])

    def first(self, cells: lattice.Nodes, level: int) -> NDArray[np.bool_]:
        """(tube,) which tubes (tube, 3, 3) of a level from the source hold marks that ask for finer ones."""
        inside = [directions for finest, directions in self.places if finest > level and len(directions)]
        if not inside:
            return np.zeros(len(cells), np.bool_)
        wanted = lattice.cell_keys(lattice.cells_of(np.concatenate(inside), level))
        return np.isin(lattice.cell_keys(cells), wanted)

    def later(self, hits: Hits, cells: lattice.Nodes) -> NDArray[np.bool_]:
        """(tube,) which tubes, on their way from a hit to `hits`, may be wider than something that they meet."""
        before = hits.before
        if before is None or len(cells) == 0:
            return np.zeros(len(cells), np.bool_)
        corner = before.rows(cells.reshape(-1, 3)).reshape(-1, 3)
        # Corners at a rim may have hit something else, which sends them elsewhere: the others stand for them.
        chain = before.chain[corner]
        most = np.where(chain[:, 1] == chain[:, 2], chain[:, 1], chain[:, 0])
        some = np.take_along_axis(chain, np.argmax(chain != 0, axis=1)[:, None], axis=1)[:, 0]
        there = (chain == np.where(most != 0, most, some)[:, None]) & (chain != 0)
        one = np.take_along_axis(corner, np.argmax(there, axis=1)[:, None], axis=1)
        rows = np.where(there, corner, one).reshape(-1)
        ray, point = before.ray[rows], before.point[rows]
        if not hits.through:
            ray = reflected_direction(ray, before.normal[rows])
        ray, point = ray.reshape(-1, 3, 3), point.reshape(-1, 3, 3)
        start, axis = point.mean(axis=1), ray.mean(axis=1)
        axis /= np.maximum(lengths(axis), 1e-9)[:, None]
        width = np.sqrt(((point - start[:, None]) ** 2).sum(axis=2)).max(axis=1)
        cos = np.einsum("tni,ti->tn", ray, axis).min(axis=1).clip(0.1, 1.0)
        opening = np.sqrt(1.0 - cos**2) / cos
        found = np.zeros(len(cells), np.bool_)
        for centre, radius, size in zip(self.centre, self.radius, self.size, strict=True):
            offset = centre - start
            along = np.einsum("ti,ti->t", offset, axis)
            across = np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0.0))
            wide = width + np.maximum(along, 0.0) * opening
            found |= (along > -radius) & (across < radius + wide) & (wide > size / ACROSS)
        return found & there.any(axis=1)
