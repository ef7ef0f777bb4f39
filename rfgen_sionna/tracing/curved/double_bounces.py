"""Glints by way of two bent surfaces: where a ray from the radar is reflected by one, then the other, and comes back.

Geometrical optics: of all that two bent surfaces show of one another, the return comes from around the places at which
the way there and back is stationary (found by :mod:`rfgen_sionna.tracing.curved.double_bounce_search`). What a wave is
like that comes back by way of them is in :mod:`rfgen_sionna.tracing.curved.arriving_waves`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import airy

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave, CurvedMirror, Route, arriving_wave, tangents
from rfgen_sionna.tracing.curved.media import SurfaceOptics
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface

SEPARATE_ARGUMENT = 20.0
"""Argument of the Airy functions beyond which two glints are two."""
MIN_CROWD = 3
"""DoubleBounces within one Fresnel zone that are taken together."""


@dataclass(frozen=True)
class DoubleBounces:
    """Glints at an instant; of their two places the one on the face of the lower number comes first."""

    facet: NDArray[np.int64]
    """(glint, 2) of the ray scene."""
    weights: FloatArray
    """(glint, 2, 3) barycentric coordinates."""
    point: FloatArray
    """(glint, 2, 3) [m]"""
    normal: FloatArray
    """(glint, 2, 3) unit, towards the ray."""
    curvature: FloatArray
    """(glint, 2, 3, 3) how the normal turns along the surface [1/m]."""
    curvature_gradient: FloatArray
    """(glint, 2, 3, 3, 3) how that changes along the surface, its first axis [1/m^2]."""

    def __len__(self) -> int:
        return len(self.facet)

    @staticmethod
    def none() -> DoubleBounces:
        """No glints."""
        vectors = np.zeros((0, 2, 3))
        tensors = np.zeros((0, 2, 3, 3))
        return DoubleBounces(np.zeros((0, 2), np.int64), vectors, vectors, vectors, tensors, np.zeros((0, 2, 3, 3, 3)))

    def take(self, index: NDArray[np.intp]) -> DoubleBounces:
        """Those that `index` counts out."""
        return DoubleBounces(*(getattr(self, each.name)[index] for each in fields(self)))

    def transported(self, surface_model: SmoothedSurface) -> DoubleBounces:
        """The same places of the surfaces a little earlier or later; `surface_model` has the faces of the first
        places, then
        those of the second."""
        count = len(self)
        face = np.arange(2 * count).reshape(2, count).T.reshape(-1)
        place = self.weights.reshape(-1, 3)
        _, point = surface_model.places(face, place)
        normal = unit_normals(surface_model, face, place).reshape(count, 2, 3)
        normal *= np.sign(np.einsum("gsi,gsi->gs", normal, self.normal))[..., None]
        return replace(self, point=point.reshape(count, 2, 3), normal=normal)

    def arrival(
        self, surface: IntArray, tx: FloatArray, rx: FloatArray, optics: SurfaceOptics
    ) -> tuple[ArrivingWave, Route]:
        """The wave of elements at `tx` (glint, 3) as it comes to `rx` (glint, 3) [m] by way of the first place, then
        the second, and its route; `surface` (face,) is that of each face."""
        of = surface[self.facet]
        mirrors = tuple(
            CurvedMirror(self.point[:, i], self.normal[:, i], self.curvature[:, i], of[:, i]) for i in range(2)
        )
        route = Route(mirrors, np.broadcast_to(rx, (len(self), 3)))
        return arriving_wave(tx, route, optics), route

    @staticmethod
    def concatenate(parts: Sequence[DoubleBounces]) -> DoubleBounces:
        """One after the other."""
        return DoubleBounces(
            *(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(DoubleBounces))
        )

    def reverse(self) -> DoubleBounces:
        """The other way round."""
        return DoubleBounces(*(getattr(self, each.name)[:, ::-1] for each in fields(self)))

    def caustic_factor(self, arrival: ArrivingWave, wavenumber: float) -> FloatArray:
        """(glint,) share that is left of what the quadratic phase alone makes of a wave, where that is flat and its
        curvature changes: two glints are about to meet and vanish. Each has the modulus of the Airy functions instead
        of its asymptote, over each principal direction of the phase (M. V. Berry and C. Upstill, Progress in Optics 18,
        1980, section 2.2)."""
        size, vectors = np.linalg.eigh(arrival.hessian)
        legs, count = arrival.legs, len(self)
        cubic = np.zeros((count, 4))
        for i in range(2):
            along = np.einsum("gia,gab->gib", tangents(self.normal[:, i]), vectors[:, 2 * i : 2 * i + 2])
            fall = np.einsum("gi,gi->g", legs[i] - legs[i + 1], self.normal[:, i])
            change = np.einsum("gkij,gkb,gib,gjb->gb", self.curvature_gradient[:, i], along, along, along)
            cubic += fall[:, None] * change
        # Half way between both the phase k (h x^2 / 2 + c x^3 / 6) is 2/3 zeta^(3/2) from that at either.
        curvature, cubic = np.maximum(np.abs(size), 1e-12), np.maximum(np.abs(cubic), 1e-12)
        zeta = np.minimum((0.5 * wavenumber * curvature**3 / cubic**2) ** (2 / 3), SEPARATE_ARGUMENT)
        ai, _, bi, _ = airy(-zeta)
        modulus = np.pi * np.cbrt(2 / (wavenumber * cubic)) * np.hypot(ai, bi)
        width = np.sqrt(2 * np.pi / (wavenumber * curvature))
        reduction = np.where(zeta < SEPARATE_ARGUMENT, np.minimum(modulus / width, 1.0), 1.0)
        return np.asarray(reduction.prod(axis=1) * self._overlap_factor(vectors, width))

    def _overlap_factor(self, vectors: FloatArray, width: FloatArray) -> FloatArray:
        """(glint,) share of a glint's own return where more than two are so close that their Fresnel zones, `width`
        (glint, 4) [m] along the principal directions `vectors` (glint, 4, 4), are one: a hollow ball has a ring of
        them, wherever its mesh is a little off. Together they return what comes from the length that they lie along."""
        count = len(self)
        share = np.ones(count)
        axes = [tangents(self.normal[:, i]) for i in range(2)]
        for n in range(count if count >= MIN_CROWD else 0):
            apart = self.point - self.point[n]
            offsets = np.concatenate([apart[:, i] @ axes[i][n] for i in range(2)], axis=1) @ vectors[n]
            near = (np.abs(offsets) <= 0.5 * width[n]).all(axis=1)
            if near.sum() >= MIN_CROWD:
                extent = np.ptp(offsets[near], axis=0)
                longest = int(np.argmax(extent))
                share[n] = min(1.0, extent[longest] / width[n, longest]) / (near.sum() - 1)
        return share


def match_points(one: FloatArray, other: FloatArray, apart: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which of the points `one` (n, k) and `other` (m, k) are nearest to each other, and within `apart`."""
    if len(one) == 0 or len(other) == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    there, back = cKDTree(other).query(one)[1], cKDTree(one).query(other)[1]
    lane = np.flatnonzero(back[there] == np.arange(len(one)))
    near = np.sqrt(((one[lane] - other[there[lane]]) ** 2).sum(axis=1)) < apart
    return lane[near], there[lane[near]]


def unit_normals(surface_model: SmoothedSurface, face: NDArray[np.int64], place: FloatArray) -> FloatArray:
    """(place, 3) unit normals of the smooth surface."""
    normal = np.einsum("pc,pci->pi", place, surface_model.normals[face])
    return np.asarray(normal / np.maximum(lengths(normal), 1e-300)[:, None])
