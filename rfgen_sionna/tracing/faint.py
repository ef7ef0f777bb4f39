"""Facets that return next to nothing beside the others of their surface.

Most of what a body returns comes from where it mirrors the radar, and most of its facets lie aslant: about how much
each returns follows from its corners, before it is looked at or integrated. The faintest are left out, until all of
them together would matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.obliquity import strongest_reflection

FAINT_PER_RTOL = 0.2
"""What facets that are left out return, one by one and by :func:`loudness`, over what the body does, per unit of the
tolerance. They do return up to twice that."""
LEAST_RTOL = 5e-3
"""Tolerance below which so few facets are that faint that to look for them takes longer."""
ASIDE = 0.6
"""Phase [rad] by which elements of an array may turn a facet without anybody asking what they see of it."""


class Facing(NamedTuple):
    """Facets that look at the radar, within the range window."""

    chosen: NDArray[np.intp]
    """(chosen,) ascending."""
    weight: FloatArray
    """(chosen,) the antennas' two-way field gain towards each, over the largest."""

    def of(self, some: NDArray[np.intp]) -> Facing:
        return Facing(self.chosen[some], self.weight[some])


class Loudness:
    """About what facets return, by their corners.

    `viewpoint` (3,) is the radar's phase centre [m], `wavenumber` that of the highest frequency [rad/m], and `aperture`
    what displacements of its elements from the middle of the array add up to [m].
    """

    def __init__(self, viewpoint: FloatArray, wavenumber: float, aperture: float) -> None:
        self._viewpoint, self._wavenumber, self._aperture = viewpoint, wavenumber, aperture
        self._of_bent, self._widest = np.zeros(0, np.intp), 0.0

    def form(self, corners: Sequence[FloatArray], of_bent: NDArray[np.intp]) -> None:
        """The facets have these `corners` (facet, 3, 3) [m], those of each surface; `of_bent` are pieces of bent
        faces."""
        away = [np.maximum(lengths(each[:, 0] - self._viewpoint), 1e-9) for each in corners]
        wide = [lengths(each - each[:, [1, 2, 0]]).max(axis=1) / far for each, far in zip(corners, away, strict=True)]
        self._of_bent, self._widest = of_bent, max((float(each.max(initial=0.0)) for each in wide), default=0.0)

    def of(self, facets: Facets, facing: Facing) -> tuple[FloatArray, FloatArray]:
        """(chosen,) about what those `facing` return, antennas included, and what they may: a wide array sees them from
        other sides as well, over a facet that is integrated in parts the phase bends, so that one part alone may return
        most, and of pieces of bent faces corners do not tell it."""
        chosen = facing.chosen
        corners = np.ascontiguousarray((np.take(facets.corners, chosen, axis=0) - self._viewpoint).T)
        loud = facing.weight * loudness(corners, self._wavenumber)
        parts, wide, most = facets.parts[chosen], self._aperture * self._wavenumber * self._widest > ASIDE, loud.copy()
        some = np.arange(len(chosen)) if wide else np.flatnonzero(parts > 1)
        if len(some):
            few = np.take(corners, some, axis=2)
            aside = phase_aside(few, self._wavenumber, self._aperture) / parts[some] if wide else 0.0
            most[some] = facing.weight[some] * loudness(few, self._wavenumber / parts[some], aside)
        if len(self._of_bent):
            pieces = np.isin(chosen, self._of_bent, assume_unique=True)
            loud[pieces], most[pieces] = 0.0, np.inf
        return loud, most


def plain(material: Material, frequencies: FloatArray) -> float:
    """What a surface reflects where it mirrors the radar, at the worst of the `frequencies` [Hz], over what it may
    where it lies aslant; 0 where it is rough, as then it scatters from everywhere."""
    if material.scattering_coefficient != 0:
        return 0.0
    number, straight = np.zeros(1, np.int32), np.ones(1)
    return min(float(strongest_reflection([material], number, straight, each)[0]) for each in frequencies[:, None])


def loudness(corners: FloatArray, wavenumber: float | FloatArray, aside: FloatArray | float = 0.0) -> FloatArray:
    """(facet,) about what facets with `corners` (axis, corner, facet) [m] from the radar return, up to a factor that
    all share: their solid angle times the mean phasor over each, by the `wavenumber` [rad/m] of all or of each and what
    the phase turns less `aside` of the radar."""
    return np.asarray(np.abs(solid_angles(corners)) * mean_phasor(corners, wavenumber, aside))


def phase_aside(corners: FloatArray, wavenumber: float, aperture: float) -> FloatArray:
    """(facet,) by how much less the phase [rad], there and back, may turn over facets for elements whose displacements
    from the middle add up to `aperture` [m]."""
    width, distance = width_and_distance(corners)
    return np.asarray(wavenumber * aperture * width / np.maximum(distance, 1e-9))


def width_and_distance(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(facet,) longest edge, and how far the nearest corner is, of facets with `corners` (axis, corner, facet) [m]."""
    square = np.zeros(corners.shape[2])
    for k in range(3):
        x, y, z = corners[:, k] - corners[:, k - 1]
        np.maximum(square, x * x + y * y + z * z, out=square)
    x, y, z = corners[0] ** 2 + corners[1] ** 2 + corners[2] ** 2
    return np.sqrt(square), np.sqrt(np.minimum(np.minimum(x, y), z))


def solid_angles(corners: FloatArray) -> FloatArray:
    """(facet,) [sr] that they take far off, below zero where they look away."""
    a, one, other = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    volume = sum(a[i] * (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2]) for i in range(3))
    x, y, z = corners[:, 0] + corners[:, 1] + corners[:, 2]
    square = np.maximum(x * x + y * y + z * z, 1e-18)  # of three times the distance of the middle
    return np.asarray(-13.5 * volume / (square * np.sqrt(square)))


def mean_phasor(corners: FloatArray, wavenumber: float | FloatArray, aside: FloatArray | float = 0.0) -> FloatArray:
    """(facet,) about how long the mean phasor over each is, there and back, by the `wavenumber` [rad/m] of all or of
    each (facet,), where the phase turns by so much [rad] less, `aside` (facet,).

    With phases a < b < c at the corners that is 2 / (c - a) times the difference of two phasors, of the lengths
    sinc((b - a) / 2) and sinc((c - b) / 2) (:mod:`rfgen_sionna.tracing.simplex`): an edge that lies across the wave's
    way returns more than a corner does.
    """
    x, y, z = np.sqrt(corners[0] ** 2 + corners[1] ** 2 + corners[2] ** 2)
    near, far = np.minimum(np.minimum(x, y), z), np.maximum(np.maximum(x, y), z)
    # Half the phases, as the way is there and back.
    total, first = wavenumber * (far - near), wavenumber * (x + y + z - 2.0 * near - far)
    second = total - first
    if np.any(aside):
        total, first, second = (np.maximum(each - 0.5 * aside, 0.0) for each in (total, first, second))
    edges = np.sqrt(1.0 / (1.0 + first**2) + 1.0 / (1.0 + second**2))
    return np.asarray(np.minimum(1.0, edges / np.maximum(total, 1e-9)))


def faintest(
    loud: FloatArray, surface: NDArray[np.integer[Any]], allowed: FloatArray
) -> tuple[NDArray[np.bool_], FloatArray]:
    """(facet,) which facets of each `surface` (facet,) are so faint, by how `loud` (facet,) they are, that all of them
    together return no more than is `allowed` (surface,) if they do not interfere; and (surface,) what they return."""
    found, left = np.zeros(len(loud), np.bool_), np.zeros(len(allowed))
    for number, most in enumerate(allowed.tolist()):
        some = np.flatnonzero((loud < most) & (loud > 0) & (surface == number))
        some = some[np.argsort(loud[some])]
        energy = np.cumsum(loud[some] ** 2)
        count = int(np.searchsorted(energy, most**2, "right"))
        found[some[:count]] = True
        left[number] = np.sqrt(energy[count - 1]) if count else 0.0
    return found, left
