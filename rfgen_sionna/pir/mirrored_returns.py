"""Diffuse returns reflected by smooth surfaces: floors, walls and panes.

Three routes by a mirror m and a rough point P count: radar, m, P, m, radar; radar, P, m, radar; and its reverse. The
mirror is flat over neighbouring rays and reflects the coherent share (1 - S^2) \\|Gamma\\|^2 of the energy. Curved
mirrors, which spread their reflections, mirrors in mirrors and the coherent returns of corners are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.pir.pixel_patches import DiffuseReturns, SceneSnapshot, diffuse_energy
from rfgen_sionna.tracing.gains.diffuse import reflectance

MIN_REFLECTANCE = 1e-3
"""Least coherently reflected share of the energy of a mirror: −30 dB of the direct return."""
_MIN_ALIGNMENT = float(np.cos(np.radians(0.5)))
"""Least cosine between the normals of neighbouring rays on a mirror: flat to half a degree."""
_SURFACE_GAP = 1e-4
"""Height of a ray's origin over the surface that it leaves [m]: above rounding, below any detail of a mesh."""


@dataclass(frozen=True)
class MirroredReturns:
    """Diffuse returns by way of mirrors."""

    arrival: FloatArray
    """(route, 3) unit vector from the viewpoint against the direction of arrival."""
    energy: FloatArray
    """(route,) expected \\|gain\\|^2, isotropic elements."""
    distance: FloatArray
    """(route,) half the path length [m]."""
    velocity: FloatArray
    """(route,) rate of `distance` [m/s]."""


def trace_mirrored(
    snapshot: SceneSnapshot,
    diffuse_returns: DiffuseReturns,
    directions: FloatArray,
    solid_angles: FloatArray,
    columns: int,
) -> MirroredReturns:
    """Diffuse returns in the mirrors among the surfaces that rays hit.

    Parameters
    ----------
    snapshot
        The scene.
    diffuse_returns
        Direct returns of the rays (:func:`~rfgen_sionna.pir.pixel_patches.trace_diffuse`).
    directions, solid_angles
        (ray, 3) unit vectors and (ray,) solid angles [sr] of the rays.
    columns
        Columns of the grid of rays.
    """
    materials, towards = snapshot.materials, directions[diffuse_returns.ray]
    mirror = (1.0 - diffuse_returns.roughness) * _reflectance(snapshot, diffuse_returns.object, diffuse_returns.cos)
    ray = np.flatnonzero((mirror > MIN_REFLECTANCE) & _is_flat(diffuse_returns, len(directions), columns))
    share, first, normal = mirror[ray], diffuse_returns.distance[ray], diffuse_returns.normal[ray]
    outgoing = towards[ray] + 2.0 * diffuse_returns.cos[ray, None] * normal
    start = snapshot.viewpoint + first[:, None] * towards[ray] + _SURFACE_GAP * normal
    hits = snapshot.rays.first_hit(start, outgoing)
    hit = np.flatnonzero(hits.object >= 0)
    ray, share, first, start, outgoing = ray[hit], share[hit], first[hit], start[hit], outgoing[hit]
    hits = hits.take(hit)
    inward = snapshot.normals(hits)
    inward /= np.maximum(np.linalg.norm(inward, axis=1), 1e-30)[:, None]
    facing = np.einsum("ri,ri->r", inward, outgoing)
    inward *= -np.sign(facing)[:, None]
    cos, total = np.maximum(np.abs(facing), 1e-3), first + np.maximum(hits.distance, 1e-3)
    solid = solid_angles[diffuse_returns.ray[ray]]
    speed = snapshot.radial_velocity(hits, outgoing)
    twice = share**2 * diffuse_energy(materials, hits.object, snapshot.frequency, cos, outgoing, inward)
    twice *= solid / total**2
    # One leg direct: another angle of incidence at P, the same solid angle of the mirror.
    points = start + hits.distance[:, None] * outgoing
    offset = points - snapshot.viewpoint
    straight = np.maximum(np.linalg.norm(offset, axis=1), 1e-3)
    direct = offset / straight[:, None]
    incidence = -np.einsum("ri,ri->r", inward, direct)
    seen = np.flatnonzero(incidence > 1e-3)
    seen = seen[~snapshot.rays.occluded(snapshot.viewpoint, points[seen] + _SURFACE_GAP * inward[seen])]
    scattered = _bistatic(snapshot, hits.object[seen], direct[seen], -outgoing[seen], inward[seen], incidence[seen])
    once = share[seen] * scattered
    once *= solid[seen] * incidence[seen] / (cos[seen] * straight[seen] ** 2)
    halves = 0.5 * (total[seen] + straight[seen])
    rate = 0.5 * (speed[seen] + snapshot.radial_velocity(hits.take(seen), direct[seen]))
    by_mirror = towards[ray]
    return MirroredReturns(
        arrival=np.concatenate([by_mirror, by_mirror[seen], direct[seen]]),
        energy=np.concatenate([twice, once, once]),
        distance=np.concatenate([total, halves, halves]),
        velocity=np.concatenate([speed, rate, rate]),
    )


def _is_flat(diffuse_returns: DiffuseReturns, rays: int, columns: int) -> NDArray[np.bool_]:
    """(hit,) whether the neighbouring rays hit the same object with the same normal."""
    hit, towards = np.full(rays, -1), np.zeros((rays, 3))
    hit[diffuse_returns.ray], towards[diffuse_returns.ray] = diffuse_returns.object, diffuse_returns.normal
    objects, normals = hit.reshape(-1, columns), towards.reshape(-1, columns, 3)
    flat = np.ones(objects.shape, dtype=np.bool_)
    for one, other in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        aligned = np.einsum("rci,rci->rc", normals[one], normals[other]) > _MIN_ALIGNMENT
        same = (objects[one] == objects[other]) & aligned
        flat[one] &= same
        flat[other] &= same
    return np.asarray(flat.ravel()[diffuse_returns.ray])


def _reflectance(snapshot: SceneSnapshot, objects: IntArray, cos: FloatArray) -> FloatArray:
    """(ray,) reflected share of the energy, for smooth surfaces of the objects' materials."""
    found = np.zeros(len(objects))
    for number in np.unique(objects).tolist():
        chosen = objects == number
        found[chosen] = reflectance(snapshot.materials[number], snapshot.frequency, cos[chosen])
    return found


def _bistatic(
    snapshot: SceneSnapshot, objects: IntArray, k_in: FloatArray, k_out: FloatArray, normal: FloatArray, cos: FloatArray
) -> FloatArray:
    """(ray,) (lambda / 4 pi)^2 S^2 \\|Gamma\\|^2 f from one direction to another."""
    found = np.zeros(len(objects))
    for number in np.unique(objects).tolist():
        chosen, material = objects == number, snapshot.materials[number]
        share = material.scattering_coefficient**2 * (1.0 - material.xpd_coefficient)
        if share:
            pattern = material.scattering_pattern(k_in[chosen], k_out[chosen], normal[chosen])
            found[chosen] = share * reflectance(material, snapshot.frequency, cos[chosen]) * pattern
    return found * (SPEED_OF_LIGHT / snapshot.frequency / (4 * np.pi)) ** 2
