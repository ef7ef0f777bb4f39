"""What smooth surfaces show a second time, of what scatters diffusely: reflections in floors, walls and panes.

Three ways by a mirror m and a rough point P count: radar, m, P, m, radar; radar, P, m, radar; and that one backwards.
The mirror reflects the coherent share (1 - S^2) \\|Gamma\\|^2 of the energy, and is
flat as far as neighbouring beams reach: curved ones spread what they reflect so that it hardly counts. Mirrors in
mirrors and the coherent returns of corners are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.pir.pixel_patches import DiffuseReturns, SceneSnapshot, diffuse_energy
from rfgen_sionna.tracing.gains.diffuse import reflectance

MIN_REFLECTANCE = 1e-3
"""Share of the energy that a surface must reflect coherently to count as a mirror."""
_MIN_ALIGNMENT = float(np.cos(np.radians(0.5)))
"""Normals of neighbouring beams on a flat surface differ by less."""
_SURFACE_GAP = 1e-4
"""Rays start this far above the surface that they leave [m]."""


@dataclass(frozen=True)
class MirroredReturns:
    """Energies by way of mirrors."""

    beam: IntArray
    """(way,) the beam, of those given, by which it leaves or arrives."""
    arrival: FloatArray
    """(way, 3) unit vector, from the viewpoint, to where it arrives from."""
    energy: FloatArray
    """(way,) expected \\|gain\\|^2, isotropic elements."""
    distance: FloatArray
    """(way,) half the length of the way there and back [m]."""
    velocity: FloatArray
    """(way,) rate of that [m/s]."""


def trace_mirrored(
    snapshot: SceneSnapshot,
    diffuse_returns: DiffuseReturns,
    directions: FloatArray,
    solid_angles: FloatArray,
    columns: int,
) -> MirroredReturns:
    """What the surfaces that beams meet show of others; `directions` and `solid_angles` [sr] are those of the beams
    that `diffuse_returns` was made from, a grid of so many `columns`."""
    materials, towards = snapshot.materials, directions[diffuse_returns.ray]
    mirror = (1.0 - diffuse_returns.roughness) * _reflectance(snapshot, diffuse_returns.object, diffuse_returns.cos)
    beam = np.flatnonzero((mirror > MIN_REFLECTANCE) & _is_flat(diffuse_returns, len(directions), columns))
    share, first, normal = mirror[beam], diffuse_returns.distance[beam], diffuse_returns.normal[beam]
    outgoing = towards[beam] + 2.0 * diffuse_returns.cos[beam, None] * normal
    start = snapshot.viewpoint + first[:, None] * towards[beam] + _SURFACE_GAP * normal
    hits = snapshot.rays.first_hit(start, outgoing)
    met = np.flatnonzero(hits.object >= 0)
    beam, share, first, start, outgoing = beam[met], share[met], first[met], start[met], outgoing[met]
    hits = hits.take(met)
    inward = snapshot.normals(hits)
    inward /= np.maximum(np.linalg.norm(inward, axis=1), 1e-30)[:, None]
    facing = np.einsum("ri,ri->r", inward, outgoing)
    inward *= -np.sign(facing)[:, None]
    cos, total = np.maximum(np.abs(facing), 1e-3), first + np.maximum(hits.distance, 1e-3)
    solid = solid_angles[diffuse_returns.ray[beam]]
    speed = snapshot.radial_velocity(hits, outgoing)
    twice = share**2 * diffuse_energy(materials, hits.object, snapshot.frequency, cos, outgoing, inward)
    twice *= solid / total**2
    # Straight one way: P is lit from the radar under another angle, and seen by the mirror under the same solid angle.
    points = start + hits.distance[:, None] * outgoing
    offset = points - snapshot.viewpoint
    straight = np.maximum(np.linalg.norm(offset, axis=1), 1e-3)
    direct = offset / straight[:, None]
    lit = -np.einsum("ri,ri->r", inward, direct)
    seen = np.flatnonzero(lit > 1e-3)
    seen = seen[~snapshot.rays.occluded(snapshot.viewpoint, points[seen] + _SURFACE_GAP * inward[seen])]
    once = share[seen] * _one_way(snapshot, hits.object[seen], direct[seen], -outgoing[seen], inward[seen], lit[seen])
    once *= solid[seen] * lit[seen] / (cos[seen] * straight[seen] ** 2)
    halves = 0.5 * (total[seen] + straight[seen])
    rate = 0.5 * (speed[seen] + snapshot.radial_velocity(hits.take(seen), direct[seen]))
    by_mirror = towards[beam]
    return MirroredReturns(
        beam=np.concatenate([beam, beam[seen], beam[seen]]).astype(np.int32),
        arrival=np.concatenate([by_mirror, by_mirror[seen], direct[seen]]),
        energy=np.concatenate([twice, once, once]),
        distance=np.concatenate([total, halves, halves]),
        velocity=np.concatenate([speed, rate, rate]),
    )


def _is_flat(diffuse_returns: DiffuseReturns, beams: int, columns: int) -> NDArray[np.bool_]:
    """(beam,) whether what lies around a beam's hit is the same object, as flat as a mirror."""
    of_all, towards = np.full(beams, -1), np.zeros((beams, 3))
    of_all[diffuse_returns.ray], towards[diffuse_returns.ray] = diffuse_returns.object, diffuse_returns.normal
    objects, normals = of_all.reshape(-1, columns), towards.reshape(-1, columns, 3)
    flat = np.ones(objects.shape, dtype=np.bool_)
    for one, other in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
    ):
        same = (objects[one] == objects[other]) & (
            np.einsum("rci,rci->rc", normals[one], normals[other]) > _MIN_ALIGNMENT
        )
        flat[one] &= same
        flat[other] &= same
    return np.asarray(flat.ravel()[diffuse_returns.ray])


def _reflectance(snapshot: SceneSnapshot, objects: IntArray, cos: FloatArray) -> FloatArray:
    """(ray,) share of the energy that a smooth surface of the object's material reflects."""
    found = np.zeros(len(objects))
    for number in np.unique(objects).tolist():
        chosen = objects == number
        found[chosen] = reflectance(snapshot.materials[number], snapshot.frequency, cos[chosen])
    return found


def _one_way(
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
