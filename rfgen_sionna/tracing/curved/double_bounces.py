"""Specular double bounces: paths from the radar by two curved surfaces and back.

By geometrical optics the return comes from the points of stationary path length (found by
:mod:`rfgen_sionna.tracing.curved.double_bounce_search`); its wave is in
:mod:`rfgen_sionna.tracing.curved.arriving_waves`.
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
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave, CurvedMirror, CurvedRoute, arriving_wave, tangents
from rfgen_sionna.tracing.curved.media import SurfaceOptics
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface

SEPARATE_ARGUMENT = 20.0
"""Argument of the Airy functions beyond which two double bounces are independent."""
MIN_CROWD = 3
"""Least number of double bounces in one Fresnel zone that share its return."""


@dataclass(frozen=True)
class DoubleBounces:
    """Specular double bounces at one time; the point on the face of lower number comes first."""

    facet: NDArray[np.int64]
    """(double bounce, 2) faces of the ray scene."""
    weights: FloatArray
    """(double bounce, 2, 3) barycentric coordinates."""
    point: FloatArray
    """(double bounce, 2, 3) [m]"""
    normal: FloatArray
    """(double bounce, 2, 3) unit, towards the ray."""
    curvature: FloatArray
    """(double bounce, 2, 3, 3) change of the normal along the surface [1/m]."""
    curvature_gradient: FloatArray
    """(double bounce, 2, 3, 3, 3) change of the curvature along the surface, first axis [1/m^2]."""

    def __len__(self) -> int:
        return len(self.facet)

    @staticmethod
    def none() -> DoubleBounces:
        """No double bounces."""
        vectors = np.zeros((0, 2, 3))
        tensors = np.zeros((0, 2, 3, 3))
        return DoubleBounces(np.zeros((0, 2), np.int64), vectors, vectors, vectors, tensors, np.zeros((0, 2, 3, 3, 3)))

    def take(self, index: NDArray[np.intp]) -> DoubleBounces:
        """Double bounces by `index`."""
        return DoubleBounces(*(getattr(self, each.name)[index] for each in fields(self)))

    def transported(self, surface_model: SmoothedSurface) -> DoubleBounces:
        """The same points of the surfaces at another time; `surface_model` has the faces of the first points, then of
        the second."""
        count = len(self)
        face = np.arange(2 * count).reshape(2, count).T.reshape(-1)
        place = self.weights.reshape(-1, 3)
        _, point = surface_model.places(face, place)
        normal = unit_normals(surface_model, face, place).reshape(count, 2, 3)
        normal *= np.sign(np.einsum("gsi,gsi->gs", normal, self.normal))[..., None]
        return replace(self, point=point.reshape(count, 2, 3), normal=normal)

    def arrival(
        self, surface: IntArray, tx: FloatArray, rx: FloatArray, optics: SurfaceOptics
    ) -> tuple[ArrivingWave, CurvedRoute]:
        """Waves of elements at `tx` (double bounce, 3) that arrive at `rx` (double bounce, 3) [m] by the first point,
        then the second, and their routes; `surface` (face,) is the surface of each face."""
        of = surface[self.facet]
        mirrors = tuple(
            CurvedMirror(self.point[:, i], self.normal[:, i], self.curvature[:, i], of[:, i]) for i in range(2)
        )
        route = CurvedRoute(mirrors, np.broadcast_to(rx, (len(self), 3)))
        return arriving_wave(tx, route, optics), route

    @staticmethod
    def concatenate(parts: Sequence[DoubleBounces]) -> DoubleBounces:
        """One after the other."""
        return DoubleBounces(
            *(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(DoubleBounces))
        )

    def reverse(self) -> DoubleBounces:
        """The other direction."""
        return DoubleBounces(*(getattr(self, each.name)[:, ::-1] for each in fields(self)))

    def caustic_factor(self, arrival: ArrivingWave, wavenumber: float) -> FloatArray:
        """(double bounce,) ratio of the uniform Airy amplitude to that of the quadratic phase, where two double bounces
        are about to merge (M. V. Berry and C. Upstill, Progress in Optics 18, 1980, section 2.2); `wavenumber` [rad/m].
        """
        size, vectors = np.linalg.eigh(arrival.hessian)
        legs, count = arrival.legs, len(self)
        cubic = np.zeros((count, 4))
        for i in range(2):
            along = np.einsum("gia,gab->gib", tangents(self.normal[:, i]), vectors[:, 2 * i : 2 * i + 2])
            fall = np.einsum("gi,gi->g", legs[i] - legs[i + 1], self.normal[:, i])
            change = np.einsum("gkij,gkb,gib,gjb->gb", self.curvature_gradient[:, i], along, along, along)
            cubic += fall[:, None] * change
        # The phase k (h x^2 / 2 + c x^3 / 6) half way between both differs by 2/3 zeta^(3/2).
        curvature, cubic = np.maximum(np.abs(size), 1e-12), np.maximum(np.abs(cubic), 1e-12)
        zeta = np.minimum((0.5 * wavenumber * curvature**3 / cubic**2) ** (2 / 3), SEPARATE_ARGUMENT)
        ai, _, bi, _ = airy(-zeta)
        modulus = np.pi * np.cbrt(2 / (wavenumber * cubic)) * np.hypot(ai, bi)
        width = np.sqrt(2 * np.pi / (wavenumber * curvature))
        reduction = np.where(zeta < SEPARATE_ARGUMENT, np.minimum(modulus / width, 1.0), 1.0)
        return np.asarray(reduction.prod(axis=1) * self._overlap_factor(vectors, width))

    def _overlap_factor(self, vectors: FloatArray, width: FloatArray) -> FloatArray:
        """(double bounce,) share of each where more than two lie in one Fresnel zone, of `width` (double bounce, 4) [m]
        along the principal directions `vectors` (double bounce, 4, 4): a hollow ball has a ring of them."""
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
    """Indices of points `one` (n, k) and `other` (m, k) that are mutual nearest neighbours within `apart`."""
    if len(one) == 0 or len(other) == 0:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    there, back = cKDTree(other).query(one)[1], cKDTree(one).query(other)[1]
    lane = np.flatnonzero(back[there] == np.arange(len(one)))
    near = np.sqrt(((one[lane] - other[there[lane]]) ** 2).sum(axis=1)) < apart
    return lane[near], there[lane[near]]


def unit_normals(surface_model: SmoothedSurface, face: NDArray[np.int64], place: FloatArray) -> FloatArray:
    """(point, 3) unit normals of the smooth surface at barycentric coordinates `place` (point, 3) of faces `face`
    (point,)."""
    normal = np.einsum("pc,pci->pi", place, surface_model.normals[face])
    return np.asarray(normal / np.maximum(lengths(normal), 1e-300)[:, None])
