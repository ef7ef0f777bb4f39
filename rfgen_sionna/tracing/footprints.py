"""Rays as beams: what each ray of a grid hits first, integrated over the patch that the ray stands for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.records import ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.facet import Nodes, facet_gains
from rfgen_sionna.tracing.obliquity import Media

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
    tracer: Tracer, t: float, viewpoint: FloatArray, field: FloatArray, directions: FloatArray, nodes: FloatArray
) -> Footprints:
    """Send rays through the middle and the corners of each patch of a grid, and integrate the patches.

    A patch whose corners meet the same object as its middle is the quadrilateral of the four points: neighbours share
    corners, so that the surface stays closed. At outlines the patch lies on the tangent plane of the middle.

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
        (row, column, 3) unit vectors through the patches' middles.
    nodes
        (row + 1, column + 1, 3) unit vectors through their corners.
    """
    columns = directions.shape[1]
    directions = directions.reshape(-1, 3)
    row, column = np.divmod(np.arange(len(directions)), columns)
    around = ((0, 0), (0, 1), (1, 1), (1, 0))
    node = np.stack([(row + down) * (columns + 1) + column + right for down, right in around], axis=1)
    nodes = nodes.reshape(-1, 3)
    rays, vertices, velocities = tracer.geometry(t)
    hits = rays.first_hit(viewpoint, directions)
    ray = np.flatnonzero(hits.object >= 0)
    if len(ray) == 0:
        return Footprints(ray.astype(np.int32), np.zeros(0, np.complex128), np.zeros(0), np.zeros(0))
    rim = rays.first_hit(viewpoint, nodes)
    corners, node = nodes[node[ray]], node[ray]
    normal, speed = np.empty((len(ray), 3)), np.zeros((len(ray), 3))
    surfaces = (*tracer.surfaces.static, *tracer.surfaces.moving)
    objects = hits.object[ray]
    frequency = np.array([tracer.radar.center_frequency])
    for number in np.unique(objects):
        chosen = np.flatnonzero(objects == number)
        surface, index = surfaces[number], ray[chosen]
        corner_ids = surface.faces[hits.face[index]]
        triangle = vertices[number][corner_ids]
        normal[chosen] = np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])
        if velocities[number] is not None:
            speed[chosen] = np.einsum("rc,rci->ri", hits.barycentric[index], velocities[number][corner_ids])
    distance, towards = hits.distance[ray], directions[ray]
    # Where a corner's ray meets the tangent plane: n . (s c - d D) = 0.
    plane = distance * np.einsum("ri,ri->r", normal, towards)
    facing = np.einsum("ri,rci->rc", normal, corners)
    safe = np.where(np.abs(facing) > 1e-12, facing, 1e-12)
    reach = np.clip(plane[:, None] / safe, distance[:, None] / _STRETCH, distance[:, None] * _STRETCH)
    # The points that the corners' rays hit, unless one of them belongs to something else or lies over an edge: further
    # from the tangent plane than the patch is wide.
    width = distance[:, None] * np.linalg.norm(corners[:, 0] - corners[:, 2], axis=1)[:, None]
    met = rim.distance[node]
    off = np.abs(met - reach)
    smooth = (rim.object[node] == objects[:, None]) & (off <= width)
    patch = np.where(smooth.all(axis=1)[:, None], np.where(np.isfinite(met), met, 0.0), reach)[..., None] * corners
    triangles = np.concatenate([patch[:, [0, 1, 2]], patch[:, [0, 2, 3]]])
    here = np.zeros((1, 3))
    media = Media.at([surface.material for surface in surfaces], frequency)
    gains = facet_gains(
        triangles, np.tile(objects, 2), media, Nodes(here, here, frequency), field, field, monostatic=True
    )
    returns = gains.a[0] * np.exp(-2j * np.pi * np.mod(frequency * gains.tau[0], 1.0))
    return Footprints(
        ray=ray.astype(np.int32),
        a=returns[: len(ray)] + returns[len(ray) :],
        distance=distance,
        velocity=np.einsum("ri,ri->r", speed, towards),
    )
