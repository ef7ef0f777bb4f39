"""Small neighbouring facets that return as one path.

A mesh has facets of a few millimetres, on hands and faces, beside some ten times as wide. Each is integrated by itself,
but what those within a patch no wider than the larger facets return is as smooth over the band, the array and time as
what one of these does: with the phase of one of them, its *leader*, they add up before paths are made of them.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths, middles

SHARE = 1.9
"""Width of a patch over the mean of its mesh's facets' longest edges, by area, per fourth root of the tolerance, as
cubics err by the fourth power."""
BAND_PHASE = 3.2
"""Phase [rad] by which an end of the band turns the near end of a patch against its far end; likewise."""
ARRAY_PHASE = 1.0
"""Phase [rad] by which an outermost element turns one end of a patch against the other; likewise."""


def widest(frequency: float, half_band: float, aperture: float, distance: float, rtol: float) -> float:
    """Width [m] that a patch may have for the radar.

    Parameters
    ----------
    frequency, half_band
        Highest frequency and half the band that is sampled [Hz].
    aperture
        Distance of the outermost virtual elements from the middle, Tx and Rx displacements added up [m].
    distance
        Range of the nearest facets [m].
    rtol
        Relative tolerance.
    """
    by_band = BAND_PHASE * SPEED_OF_LIGHT / (4 * np.pi * max(half_band, 1e-9))
    by_array = ARRAY_PHASE * SPEED_OF_LIGHT * distance / (2 * np.pi * frequency * max(aperture, 1e-9))
    return float(rtol**0.25 * min(by_band, by_array))


def leaders(
    vertices: FloatArray, faces: IntArray, parts: IntArray, whole: IntArray, most: float, rtol: float
) -> IntArray:
    """(face,) the face that leads the patch that each belongs to; itself where it is alone.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3).
    parts
        (face,) part of the body; patches do not reach from one to the next.
    whole
        Faces that are facets as a whole; others stay alone.
    most
        Width [m] that no patch may exceed.
    rtol
        Relative tolerance.

    Notes
    -----
    Patches are what of the mesh hangs together within cells of a lattice that stands on the widest face, so that they
    do not depend on where the mesh is.
    """
    alone = np.arange(len(faces), dtype=np.int32)
    if len(whole) < 2:
        return alone
    corners = vertices[faces]
    edges = corners[:, [1, 2, 0]] - corners
    longest = lengths(edges).max(axis=1)
    area = 0.5 * lengths(face_normals(vertices, faces))
    typical = float((area[whole] * longest[whole]).sum() / max(area[whole].sum(), 1e-300))
    width = min(SHARE * rtol**0.25 * typical, most)
    small = np.zeros(len(faces), np.bool_)
    small[whole] = longest[whole] < width
    if np.count_nonzero(small) < 2:
        return alone
    centres = middles(corners)
    first = int(np.flatnonzero(area >= (1.0 - 1e-6) * area.max())[0])  # of equal ones the same wherever the mesh is
    cells = np.floor((centres - corners[first, 0]) @ _frame(edges[first]).T / width).astype(np.int64)
    one, other = _neighbours(faces, np.flatnonzero(small))
    together = (cells[one] == cells[other]).all(axis=1) & (parts[one] == parts[other])
    links = coo_array((np.ones(together.sum(), np.int8), (one[together], other[together])), shape=(len(faces),) * 2)
    patch = connected_components(links, directed=False)[1]
    # The one next to the middle leads.
    weight = np.bincount(patch, area)
    middle = np.stack([np.bincount(patch, area * axis) for axis in centres.T], axis=1)
    away = lengths(centres - (middle / np.maximum(weight, 1e-300)[:, None])[patch])
    order = np.lexsort((alone, np.round(away / width, 6), patch))
    begin = np.flatnonzero(np.diff(patch[order], prepend=-1))
    return alone[order[begin]][patch]


def _frame(edges: FloatArray) -> FloatArray:
    """(3, 3) unit vectors, rows, along a face's `edges` (3, 3) [m] and across it."""
    along = edges[0] / max(float(np.linalg.norm(edges[0])), 1e-300)
    across = np.cross(along, edges[1])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.stack([along, across, np.cross(along, across)])


def _neighbours(faces: IntArray, chosen: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of `chosen` faces that share an edge."""
    run = np.sort(np.concatenate([faces[chosen][:, pair] for pair in combinations(range(3), 2)]), axis=1)
    own = np.tile(chosen, 3)
    order = np.lexsort((run[:, 1], run[:, 0]))
    same = (run[order[1:]] == run[order[:-1]]).all(axis=1)
    return own[order[:-1][same]], own[order[1:][same]]
