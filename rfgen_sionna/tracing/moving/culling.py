"""Culling of facets with a negligible return.

A body returns most where its surface is specular for the radar; most of its facets are oblique. The return of each
follows approximately from its corners, before visibility and integration. The weakest facets are omitted as long as
their sum is negligible.
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
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.return_estimates import estimate_returns, off_axis_phase

CULLED_PER_RTOL, CURVED_FACTOR = 0.2, 2.0
"""Return of omitted facets over that of the surface, both by
:func:`rfgen_sionna.tracing.surface.return_estimates.estimate_returns`, per unit of the tolerance: flat surfaces return
up to twice the estimate. The second is a factor for curved ones, whose estimates account for curvature."""
NONREFLECTING = 1e-9
"""Reflection coefficient below which a surface counts as nonreflecting."""
LEAST_RTOL = 5e-3
"""Tolerance below which too few facets are negligible for culling to pay off."""
WIDE_ARRAY_PHASE = 0.6
"""Phase [rad] between the elements over a facet above which the estimate accounts for the array."""


class FacingFacets(NamedTuple):
    """Facets that face the radar within the range window."""

    chosen: NDArray[np.intp]
    """(chosen,) ascending."""
    weight: FloatArray
    """(chosen,) two-way antenna field gain towards each, over the largest."""

    def of(self, some: NDArray[np.intp]) -> FacingFacets:
        """The facets with indices `some`."""
        return FacingFacets(self.chosen[some], self.weight[some])


class ReturnBounds:
    """Estimates and upper bounds of facets' returns, from their corners, for a phase centre `viewpoint` (3,) [m], the
    `wavenumber` at the highest frequency [rad/m] and an `aperture`, the largest sum of the displacements of a Tx and an
    Rx element from the phase centre [m]."""

    def __init__(self, viewpoint: FloatArray, wavenumber: float, aperture: float) -> None:
        self._viewpoint, self._wavenumber, self._aperture = viewpoint, wavenumber, aperture
        self._of_curved, self._widest = np.zeros(0, np.intp), 0.0

    def form(self, corners: Sequence[FloatArray], of_curved: NDArray[np.intp]) -> None:
        """Set the `corners` (facet, 3, 3) [m] of each surface's facets; `of_curved` are pieces of curved faces."""
        away = [np.maximum(lengths(each[:, 0] - self._viewpoint), 1e-9) for each in corners]
        wide = [lengths(each - each[:, [1, 2, 0]]).max(axis=1) / far for each, far in zip(corners, away, strict=True)]
        self._of_curved, self._widest = of_curved, max((float(each.max(initial=0.0)) for each in wide), default=0.0)

    def of(self, facets: Facets, facing: FacingFacets) -> tuple[FloatArray, FloatArray]:
        """(chosen,) estimated return of each of the `facing` facets with the antenna gain, and its upper bound.

        The bound is larger for a wide array, whose elements differ in aspect; for facets that are integrated in parts,
        one of which may return most; for curved facets, whose corners may face the radar more than the flat facet; and
        infinite for pieces of curved faces.
        """
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
    """Specular over largest oblique reflection at the worst of the `frequencies` [Hz]; 0 for rough surfaces, which
    scatter from everywhere."""
    if material.scattering_coefficient != 0:
        return 0.0
    number, straight = np.zeros(1, np.int32), np.ones(1)
    return min(float(strongest_reflection([material], number, straight, each)[0]) for each in frequencies[:, None])


def is_nonreflecting(material: Material, frequencies: FloatArray) -> bool:
    """Whether a surface returns nothing at any angle and any of the `frequencies` [Hz], as one of air: no tolerance can
    be relative to rounding errors."""
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
    """(facet,) whether each facet is negligible, and (surface,) the sum of the returns of these.

    `return_estimate` (facet,) are upper bounds of facets of each `surface` (facet,); `allowed` (surface,) is the
    largest sum of omitted returns, both incoherent and coherent, the latter by the `waves` of facet indices.
    """
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
