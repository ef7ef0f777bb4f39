"""Facets that return next to nothing beside the others of their surface.

Most of what a body returns comes from where it mirrors the radar, and most of its facets lie aslant: about how much
each returns follows from its corners, before it is looked at or integrated. The faintest are left out, until all of
them together would matter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.integral.obliquity import strongest_reflection
from rfgen_sionna.tracing.surface.facet_positions import estimate_returns, off_axis_phase
from rfgen_sionna.tracing.surface.facets import Facets

CULLED_PER_RTOL, CURVED_FACTOR = 0.2, 2.0
"""What facets that are left out return, one by one and by
:func:`rfgen_sionna.tracing.surface.facet_positions.estimate_returns`, over
what the body does, per unit of the tolerance. Flat ones do return up to twice that; and how many times as much it may
be of round bodies, whose facets return no more than loudness tells that knows how they are bent."""
NONREFLECTING = 1e-9
"""Reflection coefficient below which a surface is taken for none."""
LEAST_RTOL = 5e-3
"""Tolerance below which so few facets are that faint that to look for them takes longer."""
WIDE_ARRAY_PHASE = 0.6
"""Phase [rad] by which elements of an array may turn a facet without anybody asking what they see of it."""


class FacingFacets(NamedTuple):
    """Facets that look at the radar, within the range window."""

    chosen: NDArray[np.intp]
    """(chosen,) ascending."""
    weight: FloatArray
    """(chosen,) the antennas' two-way field gain towards each, over the largest."""

    def of(self, some: NDArray[np.intp]) -> FacingFacets:
        return FacingFacets(self.chosen[some], self.weight[some])


class ReturnBounds:
    """About what facets return, by their corners.

    `viewpoint` (3,) is the radar's phase centre [m], `wavenumber` that of the highest frequency [rad/m], and `aperture`
    what displacements of its elements from the middle of the array add up to [m].
    """

    def __init__(self, viewpoint: FloatArray, wavenumber: float, aperture: float) -> None:
        self._viewpoint, self._wavenumber, self._aperture = viewpoint, wavenumber, aperture
        self._of_curved, self._widest = np.zeros(0, np.intp), 0.0

    def form(self, corners: Sequence[FloatArray], of_curved: NDArray[np.intp]) -> None:
        """The facets have these `corners` (facet, 3, 3) [m], those of each surface; `of_curved` are pieces of bent
        faces."""
        away = [np.maximum(lengths(each[:, 0] - self._viewpoint), 1e-9) for each in corners]
        wide = [lengths(each - each[:, [1, 2, 0]]).max(axis=1) / far for each, far in zip(corners, away, strict=True)]
        self._of_curved, self._widest = of_curved, max((float(each.max(initial=0.0)) for each in wide), default=0.0)

    def of(self, facets: Facets, facing: FacingFacets) -> tuple[FloatArray, FloatArray]:
        """(chosen,) about what those `facing` return, antennas included, and what they may: a wide array sees them from
        other sides as well, over a facet that is integrated in parts the phase bends, so that one part alone may return
        most, where bent ones turn out of sight some corner looks at the radar more than the flat facet does, and of
        pieces of bent faces corners do not tell it."""
        chosen = facing.chosen
        if facets.return_estimate is None:
            raise ValueError("facets: how loud they are is not known")
        return_estimate = facing.weight * facets.return_estimate[chosen]
        parts, wide = facets.parts[chosen], self._aperture * self._wavenumber * self._widest > WIDE_ARRAY_PHASE
        most = facing.weight * (facets.return_estimate if facets.return_bound is None else facets.return_bound)[chosen]
        some = np.arange(len(chosen)) if wide else np.flatnonzero(parts > 1)
        if len(some):
            few = np.ascontiguousarray((np.take(facets.corners, chosen[some], axis=0) - self._viewpoint).T)
            aside = off_axis_phase(few, self._wavenumber, self._aperture) / parts[some] if wide else 0.0
            turn = None if facets.turn is None else facets.turn[chosen[some]]
            most[some] = facing.weight[some] * estimate_returns(few, self._wavenumber / parts[some], aside, turn)
        if len(self._of_curved):
            pieces = np.isin(chosen, self._of_curved, assume_unique=True)
            return_estimate[pieces], most[pieces] = 0.0, np.inf
        return return_estimate, most


def specular_reflectance(material: Material, frequencies: FloatArray) -> float:
    """What a surface reflects where it mirrors the radar, at the worst of the `frequencies` [Hz], over what it may
    where it lies aslant; 0 where it is rough, as then it scatters from everywhere."""
    if material.scattering_coefficient != 0:
        return 0.0
    number, straight = np.zeros(1, np.int32), np.ones(1)
    return min(float(strongest_reflection([material], number, straight, each)[0]) for each in frequencies[:, None])


def is_nonreflecting(material: Material, frequencies: FloatArray) -> bool:
    """Whether a surface returns nothing but what rounding leaves, at any angle and any of the `frequencies` [Hz]: one
    of air, which no tolerance can be relative to."""
    if material.scattering_coefficient != 0:
        return False
    angles = np.array([1.0, 0.5, 0.1, 0.02])
    return float(strongest_reflection([material], np.zeros(4, np.int32), angles, frequencies).max()) < NONREFLECTING


def cull_weakest(
    return_estimate: FloatArray,
    surface: NDArray[np.integer[Any]],
    allowed: FloatArray,
    waves: Callable[[NDArray[np.intp]], ComplexArray],
) -> tuple[NDArray[np.bool_], FloatArray]:
    """(facet,) which facets of each `surface` (facet,) are so faint, by how `return_estimate` (facet,) they are, that
    all of them
    together return no more than is `allowed` (surface,), whether they do not interfere or add up as those do that
    look at the radar last all around a ball, by the `waves` (facet,) that some return; and (surface,) what they do."""
    found, left = np.zeros(len(return_estimate), np.bool_), np.zeros(len(allowed))
    for number, most in enumerate(allowed.tolist()):
        some = np.flatnonzero((return_estimate < most) & (return_estimate > 0) & (surface == number))
        some = some[np.argsort(return_estimate[some])]
        energy = np.cumsum(return_estimate[some] ** 2)
        some = some[: int(np.searchsorted(energy, most**2, "right"))]
        together = np.maximum.accumulate(np.abs(np.cumsum(waves(some))))
        count = int(np.searchsorted(together, most, "right"))
        found[some[:count]] = True
        left[number] = max(np.sqrt(energy[count - 1]), together[count - 1]) if count else 0.0
    return found, left
