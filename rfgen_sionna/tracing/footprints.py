"""Rays as beams: what each ray of a grid hits first, integrated over the patch that the ray stands for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.records import ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.facet import facet_gains

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

_STRETCH = 4.0
"""A patch's corner lies at most this many times further away, or nearer, than its ray's hit: at grazing incidence the
tangent plane runs away from the surface it stands for."""


@dataclass(frozen=True)
class Footprints:
    """Monostatic returns of the patches that rays stand for; rays that hit nothing are left out."""

    ray: IntArray
    """(patch,) index of the ray."""
    a: ComplexArray
    """(patch,) gain with the propagation phase, isotropic elements."""
    distance: FloatArray
    """(patch,) distance to the hit [m]."""
    velocity: FloatArray
    """(patch,) radial velocity of the hit point [m/s], receding is positive."""


def trace_footprints(
    tracer: Tracer, t: float, viewpoint: FloatArray, field: FloatArray, directions: FloatArray, corners: FloatArray
) -> Footprints:
    """Send one ray per patch and integrate the patch on the tangent plane of what it hits.

    Parameters
    ----------
    tracer
        Geometry, materials and band; the gains are for the middle of the band.
    t
        Instant [s].
    viewpoint
        (3,) where the rays start, Tx and Rx at once [m].
    field
        (3,) direction of the electric field sent and received.
    directions
        (ray, 3) unit vectors.
    corners
        (ray, 4, 3) directions of the corners of each ray's patch, in order around it.
    """
    rays, vertices, velocities = tracer.geometry(t)
    hits = rays.first_hit(viewpoint, directions)
    ray = np.flatnonzero((hits.object >= 0) & (hits.distance < tracer.radar.max_range))
    if len(ray) == 0:
        return Footprints(ray.astype(np.int32), np.zeros(0, np.complex128), np.zeros(0), np.zeros(0))
    normal, speed = np.empty((len(ray), 3)), np.zeros((len(ray), 3))
    surfaces = (*tracer.surfaces.static, *tracer.surfaces.moving)
    objects = hits.object[ray]
    permittivity = np.empty((1, len(ray)), dtype=np.complex128)
    permeability = np.empty((1, len(ray)), dtype=np.complex128)
    frequency = np.array([tracer.radar.center_frequency])
    for number in np.unique(objects):
        chosen = np.flatnonzero(objects == number)
        surface, index = surfaces[number], ray[chosen]
        corner_ids = surface.faces[hits.face[index]]
        triangle = vertices[number][corner_ids]
        normal[chosen] = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
        if velocities[number] is not None:
            speed[chosen] = np.einsum("rc,rci->ri", hits.barycentric[index], velocities[number][corner_ids])
        permittivity[:, chosen] = surface.material.relative_permittivity(frequency)[:, None]
        permeability[:, chosen] = surface.material.relative_permeability(frequency)[:, None]
    distance, towards = hits.distance[ray], directions[ray]
    # Where a corner's ray meets the tangent plane: n . (s c - d D) = 0.
    plane = distance * np.einsum("ri,ri->r", normal, towards)
    facing = np.einsum("ri,rci->rc", normal, corners[ray])
    safe = np.where(np.abs(facing) > 1e-12, facing, 1e-12)
    reach = np.clip(plane[:, None] / safe, distance[:, None] / _STRETCH, distance[:, None] * _STRETCH)
    patch = reach[..., None] * corners[ray]
    triangles = np.concatenate([patch[:, [0, 1, 2]], patch[:, [0, 2, 3]]])
    here = np.zeros((1, 3))
    gains = facet_gains(
        triangles, here, here, field, field, np.tile(permittivity, 2), np.tile(permeability, 2), frequency
    )
    returns = gains.a[0, 0, 0] * np.exp(-2j * np.pi * np.mod(frequency * gains.tau[0, 0], 1.0))
    return Footprints(
        ray=ray.astype(np.int32),
        a=returns[: len(ray)] + returns[len(ray) :],
        distance=distance,
        velocity=np.einsum("ri,ri->r", speed, towards),
    )
