"""Returns of the surface patches behind the pixels of an image, one patch a ray.

The coherent return is integrated over patches of a few wavelengths with their phase. The diffuse return of rough
surfaces has independent phases and needs no more rays than the shapes do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.gains.diffuse import reflectance
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.propagation import phasors
from rfgen_sionna.tracing.surface.surfaces import Surface

if TYPE_CHECKING:
    from rfgen_sionna.scene.materials import Material
    from rfgen_sionna.scene.rays import Hits, RayScene
    from rfgen_sionna.tracing.tracer import Tracer

_MAX_DISTANCE_RATIO = 4.0
"""Upper bound of the ratio of distances of a patch's corner and centre: grazing tangent planes leave the surface."""


@dataclass(frozen=True)
class SceneSnapshot:
    """Scene at one time, for rays from one viewpoint."""

    rays: RayScene
    surfaces: tuple[Surface, ...]
    """Static ones first, numbered as in `rays`."""
    velocities: tuple[FloatArray | None, ...]
    """(vertex, 3) velocities of each surface [m/s]; None for a static one."""
    viewpoint: FloatArray
    """(3,) origin of the rays, position of both Tx and Rx [m]."""
    frequency: float
    """Middle of the band [Hz]."""
    num_static: int
    """Number of static surfaces."""

    @staticmethod
    def of(tracer: Tracer, t: float, viewpoint: FloatArray) -> SceneSnapshot:
        """Snapshot of a tracer's scene at `t` [s], for rays from `viewpoint` [m]."""
        rays, _, velocities = tracer.geometry(t)
        static = tracer.surfaces.static
        return SceneSnapshot(
            rays, (*static, *tracer.surfaces.moving), tuple(velocities), np.asarray(viewpoint, dtype=np.float64),
            tracer.radar.center_frequency, len(static),
        )  # fmt: skip

    @property
    def materials(self) -> list[Material]:
        """Material of each surface."""
        return [surface.material for surface in self.surfaces]

    def normals(self, hits: Hits) -> FloatArray:
        """(ray, 3) normals of the hit faces to either side, of length twice the area [m^2]."""
        triangle = self.rays.corners(hits.facet)
        return np.cross(triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0])

    def radial_velocity(self, hits: Hits, towards: FloatArray) -> FloatArray:
        """(ray,) velocities of the hit points along the unit vectors `towards` (ray, 3) [m/s]."""
        found = np.zeros(len(hits.object))
        for number in range(self.num_static, len(self.surfaces)):
            speed = self.velocities[number]
            chosen = np.flatnonzero(hits.object == number)
            if speed is None or not len(chosen):
                continue
            corners = speed[self.surfaces[number].faces[hits.face[chosen]]]
            point = np.einsum("rc,rci->ri", hits.barycentric[chosen], corners)
            found[chosen] = np.einsum("ri,ri->r", point, towards[chosen])
        return found


@dataclass(frozen=True)
class PatchReturns:
    """Monostatic coherent returns of the patches of rays with a hit."""

    ray: IntArray
    """(patch,) index of the ray."""
    a: ComplexArray
    """(patch,) gain with the propagation phase, isotropic elements."""
    distance: FloatArray
    """(patch,) distance to the hit [m]."""
    velocity: FloatArray
    """(patch,) radial velocity of the hit point [m/s], receding is positive."""


@dataclass(frozen=True)
class DiffuseReturns:
    """Monostatic diffuse returns of rays with a hit."""

    ray: IntArray
    """(hit,) index of the ray."""
    object: IntArray
    """(hit,) index of the surface."""
    energy: FloatArray
    """(hit,) expected \\|gain\\|^2 of the diffuse part, isotropic elements."""
    roughness: FloatArray
    """(hit,) diffuse share S^2 of the reflected energy."""
    cos: FloatArray
    """(hit,) cosine of the angle of incidence."""
    normal: FloatArray
    """(hit, 3) unit normal towards the viewpoint."""
    distance: FloatArray
    """(hit,) distance to the hit [m]."""
    velocity: FloatArray
    """(hit,) radial velocity of the hit point [m/s], receding is positive."""


def trace_diffuse(snapshot: SceneSnapshot, directions: FloatArray, solid_angles: FloatArray) -> DiffuseReturns:
    """Diffuse returns along `directions` (ray, 3) of `solid_angles` (ray,) [sr].

    A surface at distance R that fills the solid angle W returns

        (lambda / 4 pi)^2 S^2 \\|Gamma\\|^2 f W / R^2

    of the incident energy, with the scattering pattern f of facets (:mod:`rfgen_sionna.tracing.gains.diffuse`), whose
    area is W R^2 / cos(theta).
    """
    hits = snapshot.rays.first_hit(snapshot.viewpoint, directions)
    ray = np.flatnonzero(hits.object >= 0)
    hits, towards = hits.take(ray), directions[ray]
    normal = snapshot.normals(hits)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    facing = np.einsum("ri,ri->r", normal, towards)
    normal *= -np.sign(facing)[:, None]
    cos = np.clip(np.abs(facing), 0.0, 1.0)
    rough = np.array([material.scattering_coefficient for material in snapshot.materials])[hits.object] ** 2
    energy = diffuse_energy(snapshot.materials, hits.object, snapshot.frequency, cos, towards, normal)
    energy *= solid_angles[ray] / np.maximum(hits.distance, 1e-4) ** 2
    return DiffuseReturns(
        ray=ray.astype(np.int32), object=hits.object, energy=energy, roughness=rough, cos=cos, normal=normal,
        distance=hits.distance, velocity=snapshot.radial_velocity(hits, towards),
    )  # fmt: skip


def diffuse_energy(
    materials: Sequence[Material],
    of: IntArray,
    frequency: float,
    cos: FloatArray,
    towards: FloatArray,
    normal: FloatArray,
) -> FloatArray:
    """(ray,) (lambda / 4 pi)^2 S^2 \\|Gamma\\|^2 f, co-polar and monostatic, of rays that hit material number `of`.

    Parameters
    ----------
    materials
        Materials by number.
    of
        (ray,) number of the material.
    frequency
        [Hz].
    cos
        (ray,) cosine of the angle of incidence.
    towards, normal
        (ray, 3) unit vectors of the rays and of the surface.
    """
    found = np.zeros(len(of))
    scale = (SPEED_OF_LIGHT / frequency / (4 * np.pi)) ** 2
    numbers: dict[Material, list[int]] = {}
    for number, material in enumerate(materials):
        numbers.setdefault(material, []).append(number)
    for material, users in numbers.items():
        share = material.scattering_coefficient**2 * (1.0 - material.xpd_coefficient)
        chosen = np.flatnonzero(np.isin(of, users)) if share else ()
        if len(chosen):
            pattern = material.scattering_pattern(towards[chosen], -towards[chosen], normal[chosen])
            found[chosen] = scale * share * reflectance(material, frequency, cos[chosen]) * pattern
    return found


def trace_patches(
    snapshot: SceneSnapshot,
    field: FloatArray,
    directions: FloatArray,
    nodes: FloatArray,
    node: NDArray[np.integer[Any]],
) -> PatchReturns:
    """Coherent returns of patches, from rays through their centres and corners.

    A patch whose corners hit the same object as its centre is the quadrilateral of the four points: neighbours share
    corners, so that the surface stays closed. At silhouettes the patch lies on the tangent plane of the centre.

    Parameters
    ----------
    snapshot
        The scene; gains are for the middle of the band.
    field
        (3,) direction of the electric field sent and received.
    directions
        (ray, 3) unit vectors through the patches' centres.
    nodes
        (node, 3) unit vectors through corners.
    node
        (ray, 4) corners of each patch, in a cycle.
    """
    hits = snapshot.rays.first_hit(snapshot.viewpoint, directions)
    ray = np.flatnonzero(hits.object >= 0)
    if len(ray) == 0:
        return PatchReturns(ray.astype(np.int32), np.zeros(0, np.complex128), np.zeros(0), np.zeros(0))
    node_hits = snapshot.rays.first_hit(snapshot.viewpoint, nodes)
    hits, node, towards = hits.take(ray), node[ray], directions[ray]
    corners, normal, objects, distance = nodes[node], snapshot.normals(hits), hits.object, hits.distance
    # Intersection of a corner's ray with the tangent plane: n . (s c - d D) = 0.
    plane = distance * np.einsum("ri,ri->r", normal, towards)
    facing = np.einsum("ri,rci->rc", normal, corners)
    safe = np.where(np.abs(facing) > 1e-12, facing, 1e-12)
    reach = np.clip(
        plane[:, None] / safe, distance[:, None] / _MAX_DISTANCE_RATIO, distance[:, None] * _MAX_DISTANCE_RATIO
    )
    # Hits of the corners' rays, unless one is on another object or over an edge: further from the tangent plane than
    # the patch is wide.
    width = distance[:, None] * np.linalg.norm(corners[:, 0] - corners[:, 2], axis=1)[:, None]
    hit = node_hits.distance[node]
    smooth = (node_hits.object[node] == objects[:, None]) & (np.abs(hit - reach) <= width)
    patch = np.where(smooth.all(axis=1)[:, None], np.where(np.isfinite(hit), hit, 0.0), reach)[..., None] * corners
    triangles = np.concatenate([patch[:, [0, 1, 2]], patch[:, [0, 2, 3]]])
    here, frequency = np.zeros((1, 3)), np.array([snapshot.frequency])
    media = Media.at(snapshot.materials, frequency)
    gains = facet_gains(
        triangles, np.tile(objects, 2), media, Nodes(here, here, frequency), field, field, monostatic=True
    )
    returns = gains.a[0] * phasors(frequency * gains.tau[0])
    return PatchReturns(
        ray=ray.astype(np.int32),
        a=returns[: len(ray)] + returns[len(ray) :],
        distance=distance,
        velocity=snapshot.radial_velocity(hits, towards),
    )
