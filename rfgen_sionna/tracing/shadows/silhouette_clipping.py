"""What rims of slabs and mirrors leave of facets: the parts that are seen one and the same way."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.shadows.adaptive_sampling import (
    CORNER_ERROR,
    CURVED_EDGE_ERROR,
    MISSED_PER_RTOL,
    error_budget,
)
from rfgen_sionna.tracing.shadows.lattices import SPACINGS, points_of
from rfgen_sionna.tracing.shadows.visible_polygons import VisibilitySampler, find_visible_polygons

_BATCH = 300_000
"""Points that are looked at together."""


class ClippedFacets(NamedTuple):
    """What is seen of facets that rims cut."""

    share: FloatArray
    """(facet,) of its area."""
    owner: NDArray[np.intp]
    """(piece,) facet that each is of, ascending; those that matter little are not cut."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""
    missed: float
    """Estimated error of what they return, relative to `level`."""


def clip_by_silhouettes(
    sampler: Callable[[NDArray[np.intp]], VisibilitySampler],
    cut: FloatArray,
    width: FloatArray,
    share: FloatArray,
    level: float,
    rtol: float,
) -> ClippedFacets:
    """Look at facets on lattices, the finer the more may be missed, as
    :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.sampled_fraction` does where shadows fall.

    Parameters
    ----------
    look
        What tells which points are seen of the facets that it is given the numbers of.
    cut, width
        (facet,) what each may return where a straight edge cuts it, and the phase between its ends, there and back
        [rad], as of :func:`rfgen_sionna.tracing.shadows.return_bounds.returns_at_most`.
    share
        (facet,) of each that guiding rays tell of.
    level
        What all facets return without interfering, in units of `cut`.
    rtol
        Allowed error of the return of all together.
    """
    bent, share = CURVED_EDGE_ERROR * cut, share.copy()
    wanted = np.sqrt(bent / error_budget(bent, MISSED_PER_RTOL * rtol * level))
    cells = np.searchsorted(SPACINGS[:-1], wanted)
    sampled = wanted > np.sqrt(CURVED_EDGE_ERROR / CORNER_ERROR)
    missed = np.where(sampled, bent / np.array(SPACINGS)[cells] ** 2, CORNER_ERROR * cut * ((share > 0) & (share < 1)))
    some = np.flatnonzero(sampled)
    owners, pieces = [np.zeros(0, np.intp)], [np.zeros((0, 3, 3))]
    batch = np.cumsum(points_of(cells[some])) // _BATCH
    for own in np.split(some, np.flatnonzero(np.diff(batch)) + 1):
        unoccluded = find_visible_polygons(sampler(own), cells[own], width[own])
        share[own] = unoccluded.fraction
        missed[np.setdiff1d(own, own[unoccluded.owner])] = 0.0  # no rim is on it
        order = np.argsort(unoccluded.owner, kind="stable")
        owners.append(own[unoccluded.owner[order]])
        pieces.append(unoccluded.pieces[order])
    error = float(np.linalg.norm(missed)) / level if level > 0 else 0.0
    return ClippedFacets(share, np.concatenate(owners), np.concatenate(pieces), error)
