"""Facets of several surfaces, in arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.scene.kernels import concatenate_aligned
from rfgen_sionna.scene.mesh import lengths, max_component, triangle_centroids
from rfgen_sionna.tracing.surface.facet_positions import place_facets
from rfgen_sionna.tracing.surface.quadratic_patch import QUARTERS, QuadraticPatch, split_facets, split_values
from rfgen_sionna.tracing.surface.surfaces import Surface
from rfgen_sionna.tracing.surface.tessellate import Tessellation

CANCELLED = 0.01
"""Share of the strongest facet's return below which a coherent return counts as cancelled and is no reference level."""
RATE_STEP = 0.5e-3
"""Half the time step [s] of differences for delay rates: error jerk x step^2 / 6, below 0.1 mm/s."""

_NO_NUMBERS = np.zeros(0, np.int32)
_COLUMNS = ("number", "face", "surface", "facing", "parts", "place")
_OPTIONAL_COLUMNS = ("curved", "pattern_gradient", "gradient_origin", "grain")


@dataclass(frozen=True)
class Facets:
    """Pieces of surfaces at one time: flat triangles and their quadratic patches."""

    corners: FloatArray
    """(facet, 3, 3) corners of the flat triangles [m], world; rays meet these."""
    number: IntArray
    """(facet,) face among all faces of the ray scene."""
    face: IntArray
    """(facet,) face within its surface."""
    surface: IntArray
    """(facet,) position in the list of surfaces."""
    facing: NDArray[np.bool_]
    """(facet,) whether it can be visible; False where a closed surface faces away."""
    parts: IntArray
    """(facet,) parts per edge of the integral."""
    place: IntArray
    """(facet,) persistent number of the facet, or of its grain, within the face."""
    patch: QuadraticPatch | None = field(default=None, kw_only=True)
    """Quadratic patches; None means flat facets."""
    curved: NDArray[np.bool_] | None = field(default=None, kw_only=True)
    """(facet,) whether a facet is bent; None means no facet."""
    pattern_gradient: FloatArray | None = field(default=None, kw_only=True)
    """(facet, 3) gradient of the two-way pattern gain's logarithm [1/m]; None means constant gain per facet."""
    gradient_origin: FloatArray | None = field(default=None, kw_only=True)
    """(facet, 3) points [m] of the gain that `pattern_gradient` refers to; None means the centroids."""
    return_estimate: FloatArray | None = field(default=None, kw_only=True)
    """(facet,) :func:`~rfgen_sionna.tracing.surface.return_estimates.estimate_returns`; None if unknown."""
    grain: FloatArray | None = field(default=None, kw_only=True)
    """(facet, 4) :attr:`~rfgen_sionna.tracing.surface.tessellate.Tessellation.shares`; None: each facet is a grain."""

    def __len__(self) -> int:
        return len(self.number)

    def take(self, index: NDArray[np.intp]) -> Facets:
        """Facets `index` (no mask)."""
        return Facets.taken([self], index)[0]

    @staticmethod
    def taken(every: Sequence[Facets], index: NDArray[np.intp]) -> list[Facets]:
        """:meth:`take` of the same facets at several times; shared arrays stay shared, estimates are dropped."""
        shared: dict[str, tuple[NDArray[Any], NDArray[Any]]] = {}

        def some(each: Facets, name: str) -> Any:
            values = getattr(each, name)
            if values is None:
                return None
            if name not in shared or shared[name][0] is not values:
                shared[name] = values, np.take(values, index, axis=0)
            return shared[name][1]

        taken = []
        for each in every:
            columns = {name: some(each, name) for name in ("corners", *_COLUMNS, *_OPTIONAL_COLUMNS)}
            found = Facets(patch=None if each.patch is None else each.patch.take(index), **columns)
            if "centroids" in each.__dict__:
                found.__dict__["centroids"] = some(each, "centroids")
            taken.append(found)
        return taken

    def with_pattern_gradient(self, pattern_gradient: FloatArray | None) -> Facets:
        """Copy with this :attr:`pattern_gradient` about the centroids."""
        return self._with(pattern_gradient=pattern_gradient, gradient_origin=None)

    def _with(self, **changed: Any) -> Facets:
        found = replace(self, **changed)
        if "centroids" in self.__dict__:
            found.__dict__["centroids"] = self.centroids
        return found

    def finer(self) -> tuple[Facets, NDArray[np.intp]]:
        """Facets of half the width where bent, of twice the parts where flat, and the index (finer facet,) of the
        original. They have no :attr:`pattern_gradient`."""
        split = np.zeros(len(self), np.bool_) if self.curved is None else self.curved
        flat, bent = np.flatnonzero(~split), np.flatnonzero(split)
        index = np.concatenate([flat, np.repeat(bent, len(QUARTERS))])
        count = len(flat)
        none: dict[str, Any] = dict.fromkeys(("patch", "pattern_gradient", "gradient_origin", "grain"))
        found = replace(self, corners=np.zeros((len(self), 0, 3)), **none).take(index)
        corners = np.empty((len(index), 3, 3))
        np.take(self.corners, flat, axis=0, out=corners[:count])
        found.parts[:count] *= 2
        patch = None
        if self.patch is not None:
            own = self.patch.take(bent).divided(QUARTERS)
            corners[count:] = split_values(QUARTERS, np.take(self.corners, bent, axis=0))
            patch = own if not count else QuadraticPatch.stack([QuadraticPatch(np.zeros((count, 3, 3))), own])
        return replace(found, corners=corners, patch=patch), index

    @staticmethod
    def joined(parts: Sequence[Facets]) -> Facets:
        """Facets of the same surfaces, one after the other."""
        if len(parts) == 1:
            return parts[0]
        patches = [each.patch for each in parts if each.patch is not None]
        found = Facets(
            concatenate_aligned([each.corners for each in parts]),
            *(np.concatenate([getattr(each, name) for each in parts]) for name in _COLUMNS),
            patch=QuadraticPatch.stack(patches) if patches else None,
            curved=np.concatenate([each.curved for each in parts if each.curved is not None]) if patches else None,
            pattern_gradient=_filled(parts, "pattern_gradient", lambda each: np.zeros((len(each), 3))),
            gradient_origin=_filled(parts, "gradient_origin", lambda each: each.centroids),
            grain=_filled(parts, "grain", lambda each: _own_grains(len(each))),
        )
        if all("centroids" in each.__dict__ for each in parts):
            found.__dict__["centroids"] = np.concatenate([each.centroids for each in parts])
        return found

    def at(self, corners: FloatArray, patch: QuadraticPatch | None) -> Facets:
        """Facets at several times, time by time, with their `corners` (time, facet, 3, 3) [m] and `patch` there."""
        index = np.tile(np.arange(len(self)), len(corners))
        return replace(self.take(index), corners=corners.reshape(-1, 3, 3), patch=patch)

    def cut(self, owner: NDArray[np.intp], weights: FloatArray) -> Facets:
        """Pieces at barycentric coordinates `weights` (piece, 3, 3) of the facets `owner` (piece,), with parts of at
        most the same width. Their pattern gain refers to the facets' points."""
        corners, patch, width = split_facets(self.corners, self.patch, owner, weights)
        found = replace(self, corners=np.zeros((len(self), 0, 3)), patch=None, grain=None).take(owner)
        parts = np.ceil(found.parts * width - 1e-9).astype(np.int32)
        place = _piece_keys(found.place, weights)
        gradient_origin = found.gradient_origin
        if self.pattern_gradient is not None and gradient_origin is None:
            gradient_origin = np.take(self.centroids, owner, axis=0)
        changed: dict[str, Any] = {"parts": np.maximum(parts, 1), "place": place, "gradient_origin": gradient_origin}
        return replace(found, corners=corners, patch=patch, **changed)

    @cached_property
    def centroids(self) -> FloatArray:
        """(facet, 3) reference points of the delays [m]"""
        return triangle_centroids(self.corners)

    def directions(self, viewpoint: FloatArray, chosen: NDArray[np.intp] | slice = slice(None)) -> FloatArray:
        """(facet, 3) unit vectors from the viewpoint (3,) [m] to the centroids of the `chosen` facets."""
        offset = self.centroids[chosen] - viewpoint
        return np.asarray(offset / np.maximum(lengths(offset), 1e-12)[:, None], dtype=np.float64)


def sum_by_surface(values: ComplexArray, index: IntArray, count: int) -> ComplexArray:
    """(probe, count) sums of `values` (probe, facet) by the facets' `index` (facet,)."""
    return np.stack([np.bincount(index, row.real, count) + 1j * np.bincount(index, row.imag, count) for row in values])


def curvature(facets: Facets, index: NDArray[np.intp]) -> FloatArray:
    """(index,) estimate of the largest curvature [1/m] of facets: 8 h / L^2 for an edge of length L and sagitta h."""
    if facets.patch is None:
        return np.zeros(len(index))
    corners = np.take(facets.corners, index, axis=0)
    edges = corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]]
    square = np.maximum(np.einsum("fei,fei->fe", edges, edges), 1e-18)
    return max_component(8.0 * lengths(np.take(facets.patch.sagittas, index, axis=0)) / square)


def _own_grains(count: int) -> FloatArray:
    """:attr:`Facets.grain` of `count` facets that are grains."""
    return np.tile([1.0, 1 / 3, 1 / 3, 1 / 3], (count, 1))


def _filled(parts: Sequence[Facets], name: str, otherwise: Callable[[Facets], NDArray[Any]]) -> Any:
    """Arrays `name` of the `parts` in turn, with `otherwise` for missing ones; None if all are missing."""
    own = [getattr(each, name) for each in parts]
    if all(each is None for each in own):
        return None
    return concatenate_aligned(
        [otherwise(part) if each is None else each for part, each in zip(parts, own, strict=True)]
    )


def stack_facets(
    surfaces: Sequence[Surface],
    tessellations: Sequence[Tessellation],
    vertices: Sequence[Sequence[FloatArray]],
    viewpoint: FloatArray,
    wavenumber: float,
) -> list[Facets]:
    """Flat facets of all surfaces, in their order, at every time, for `vertices` (time, surface) of (vertex, 3) [m].
    :func:`with_patches` bends them. Returns are estimated at a `wavenumber` [rad/m]."""
    pairs = list(zip(surfaces, tessellations, strict=True))
    grains = [_own_grains(len(each.face)) if each.shares is None else each.shares for each in tessellations]
    grain = np.concatenate(grains) if any(each.shares is not None for each in tessellations) else None
    placed = []
    for k, (surface, piece) in enumerate(pairs):
        points = [there[k] for there in vertices]
        placed.append(place_facets(piece, surface.faces, points, viewpoint, wavenumber))
    number = _stacked(piece.face + np.int32(surface.first_facet) for surface, piece in pairs)
    face = _stacked(piece.face for piece in tessellations)
    index = _stacked(np.full(len(piece.face), k, dtype=np.int32) for k, piece in enumerate(tessellations))
    parts = _stacked(piece.parts for piece in tessellations)
    place, curved = _stacked(piece.places for piece in tessellations), None
    if any(surface.smooth is not None for surface in surfaces):
        smooth = (np.full(len(piece.face), surface.smooth is not None) for surface, piece in pairs)
        curved = _stacked(smooth, np.zeros(0, np.bool_))
    found = []
    for k in range(len(vertices)):
        towards = zip(surfaces, (each.towards[k] for each in placed), strict=True)
        facing = (own if surface.closed else np.ones(len(own), np.bool_) for surface, own in towards)
        corners, centroids, return_estimate = (
            _stacked((getattr(each, name)[k] for each in placed), np.zeros((0, *shape)))
            for name, shape in (("corners", (3, 3)), ("centroids", (3,)), ("return_estimate", ()))
        )
        there = Facets(
            corners, number, face, index, _stacked(facing, np.zeros(0, np.bool_)), parts, place,
            curved=curved, return_estimate=return_estimate, grain=grain,
        )  # fmt: skip
        there.__dict__["centroids"] = centroids
        found.append(there)
    return found


def with_patches(
    facets: Sequence[Facets],
    surfaces: Sequence[Surface],
    tessellations: Sequence[Tessellation],
    vertices: Sequence[Sequence[FloatArray]],
) -> list[Facets]:
    """The same `facets` of all surfaces at several times, bent, for `vertices` (time, surface) of (vertex, 3) [m]."""
    if facets[0].curved is None:
        return list(facets)
    patches = [
        piece.patches(points, surface.faces, surface.smooth)
        for surface, piece, points in zip(surfaces, tessellations, zip(*vertices, strict=True), strict=True)
    ]
    every = [own[0] if len(own) == 1 else QuadraticPatch.stack(own) for own in zip(*patches, strict=True)]
    return [each._with(patch=own) for each, own in zip(facets, every, strict=True)]


def _stacked(parts: Iterable[NDArray[Any]], empty: NDArray[Any] = _NO_NUMBERS) -> NDArray[Any]:
    """Arrays one after the other, without a copy of a single one; `empty` without any."""
    found = list(parts)
    return found[0] if len(found) == 1 else np.concatenate([empty, *found])


def facet_paths(
    surfaces: Sequence[Surface],
    facets: Facets,
    times: FloatArray,
    coefficients: ComplexArray,
    tau: FloatArray,
    tau_rate: FloatArray,
    direction: FloatArray,
    frequency: float,
    half_band: float,
    names: tuple[tuple[str, ...], tuple[str, ...]],
) -> RadarPaths:
    """Paths from gain coefficients (order, tx, rx, facet, time), delays `tau` [s] and `tau_rate` [s/s] (tx, rx, facet,
    time). `direction` are unit vectors at the radar, `names` those of objects and parts."""
    objects = np.array([surface.object_id for surface in surfaces], dtype=np.int32)
    parts = np.zeros(len(facets), dtype=np.int32)
    for position, surface in enumerate(surfaces):
        chosen = facets.surface == position
        parts[chosen] = surface.parts[facets.face[chosen]]
    return RadarPaths(
        a=coefficients[0],
        tau=tau,
        tau_rate=tau_rate,
        times=times,
        frequency=frequency,
        direction=direction,
        arrival=direction,
        object_id=objects[facets.surface] if len(facets) else np.zeros(0, np.int32),
        part_id=parts,
        kind=np.full(len(facets), PathKind.FACET, dtype=np.uint8),
        bounces=np.ones(len(facets), dtype=np.uint8),
        object_names=names[0],
        part_names=names[1],
        facet=facets.face,
        dispersion=coefficients[1:] if len(coefficients) > 1 else None,
        half_band=half_band if len(coefficients) > 1 else 0.0,
    )


def _piece_keys(place: IntArray, weights: FloatArray) -> IntArray:
    """(piece,) persistent numbers of pieces at `weights` (piece, 3, 3) of facets numbered `place` (piece,)."""
    middle = np.rint((weights[:, 0, :2] + weights[:, 1, :2] + weights[:, 2, :2]) * (2**15 / 3)).astype(np.uint64)
    z = place.astype(np.uint32).astype(np.uint64) << np.uint64(32) | middle[:, 0] << np.uint64(16) | middle[:, 1]
    return np.asarray((mix_bits(z) >> np.uint64(32)).astype(np.uint32).view(np.int32))


def mix_bits(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Numbers of which every bit depends on all bits of `key`: the finaliser of SplitMix64 (G. L. Steele, D. Lea and C.
    H. Flood, Fast splittable pseudorandom number generators, OOPSLA 2014)."""
    with np.errstate(over="ignore"):
        z = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
