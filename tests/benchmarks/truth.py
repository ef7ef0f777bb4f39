"""What the benchmark holds answers against: series, closed forms, image theory, dense quadrature."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.smooth import edge_rises, smoothing
from tests.reference.physical_optics import fresnel, triangle_points

CHUNK = 1 << 18
"""Points at a time."""
POINTS = (6, 8, 10, 12, 16, 20, 24, 32, 40)
"""Points along an edge; faces that would need more are split first."""


def mie_section(radius: float, frequency: float) -> float:
    """Backscattering cross section of a metal sphere [m^2]."""
    import miepython

    # miepython's Q_back is sigma / (pi a^2); a huge imaginary index is a perfect conductor.
    size = 2 * np.pi * radius * frequency / SPEED_OF_LIGHT
    return float(miepython.efficiencies_mx(1.0 - 1e6j, size)[2]) * np.pi * radius**2


def sphere_gain(radius: float, distance: FloatArray, frequency: float) -> ComplexArray:
    """Channel of a metal sphere with its middle at `distance` [m]: Mie's level, referred to the near-field divergence
    R (R - a), with the phase of the point that is nearest. A constant phase is left open."""
    wavelength = SPEED_OF_LIGHT / frequency
    level = wavelength * np.sqrt(mie_section(radius, frequency))
    level = level / ((4 * np.pi) ** 1.5 * distance * (distance - radius))
    return np.asarray(-level * np.exp(-4j * np.pi * (distance - radius) / wavelength))


def section_gain(section: float, distance: FloatArray, frequency: float) -> ComplexArray:
    """Channel of a far point-like reflector of `section` [m^2]; a constant phase is left open."""
    wavelength = SPEED_OF_LIGHT / frequency
    level = wavelength * np.sqrt(section) / ((4 * np.pi) ** 1.5 * distance**2)
    return np.asarray(level * np.exp(-4j * np.pi * distance / wavelength))


@dataclass(frozen=True)
class Quadrature:
    """Physical optics of a mesh from its definition: Gauss-Legendre points on each face that faces the radar, as many
    as the phase over it asks for, each with its own obliquity, distance and visibility. One element sends and receives.

    At 77 GHz a person takes a million points.
    """

    points: FloatArray
    """(point, 3) [m]."""
    normal: FloatArray
    """(point, 3) unit."""
    area: FloatArray
    """(point,) [m^2], 0 where something hides it."""
    permittivity: complex
    field: FloatArray
    """(3,) direction of the element's field."""

    @classmethod
    def of(
        cls,
        vertices: FloatArray,
        faces: IntArray,
        viewpoint: FloatArray,
        frequency: float,
        permittivity: complex,
        field: FloatArray,
        rays: RayScene | None,
        first_facet: int = 0,
        oversampling: float = 1.0,
        smooth: bool = False,
    ) -> Quadrature:
        """Points in a frame with the viewpoint at the origin.

        `rays` tells what hides points (None: nothing does), with the mesh's faces numbered from `first_facet` on;
        `oversampling` multiplies the density of the points. Of a `smooth` mesh the quadratic surface through its
        corners and the middles of its bowed edges is integrated: where that is, is the package's to define
        (:mod:`rfgen_sionna.tracing.smooth`); what it returns is found here. What hides its points is the flat mesh.
        """
        corners = vertices[faces] - viewpoint
        found = smoothing(vertices, faces) if smooth else None
        rises = np.zeros_like(corners) if found is None else edge_rises(corners, found.normals(vertices, faces))
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face = np.flatnonzero((crosses * corners[:, 0]).sum(axis=1) < 0)
        pieces = np.broadcast_to(np.eye(3), (len(face), 3, 3))
        wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT * oversampling
        parts: list[tuple[FloatArray, ...]] = []
        while len(face):
            # Gauss-Legendre needs two points per wavelength of the path and some more; the collapsed square has its
            # long side along an edge.
            wanted = POINTS[0] + 2 * wavenumber * _spread(pieces @ corners[face]) / np.pi
            fine = wanted <= POINTS[-1]
            chosen = np.searchsorted(POINTS, wanted)
            for index, count in enumerate(POINTS):
                group = np.flatnonzero(fine & (chosen == index))
                if not len(group):
                    continue
                local, weight = triangle_points(np.eye(3)[None], count)
                place = (local @ pieces[group]).reshape(-1, 3)
                share = np.linalg.det(pieces[group])  # of the face's area
                number = np.repeat(face[group], len(weight))
                parts.append((place, np.outer(np.abs(share), weight).ravel(), number))
            face, pieces = np.tile(face[~fine], 4), _quartered(pieces[~fine])
        place, weight, number = (np.concatenate(each) for each in zip(*parts, strict=True))
        made = []
        for first in range(0, len(place), CHUNK):
            chunk = slice(first, first + CHUNK)
            own = number[chunk]
            if found is None:
                flat = point = np.einsum("pc,pci->pi", place[chunk], corners[own])
                cross = crosses[own]
            else:
                flat, point, cross = _surface(place[chunk], corners[own], rises[own])
            seen = slice(None) if rays is None else ~rays.occluded(viewpoint, flat + viewpoint, own + first_facet)
            twice = np.linalg.norm(cross, axis=1)
            made.append((point[seen], (cross / twice[:, None])[seen], (0.5 * twice * weight[chunk])[seen]))
        points, normal, area = (np.concatenate(each) for each in zip(*made, strict=True))
        return cls(points, normal, area, permittivity, np.asarray(field, dtype=np.float64))

    def gain(self, offset: FloatArray, frequency: float, permittivity: complex | None = None) -> complex:
        """Channel with all points moved by `offset` (3,) [m]: small against what changes visibility."""
        total = 0j
        for weight, distance in self.strengths(offset, permittivity):
            phase = np.mod(2 * frequency / SPEED_OF_LIGHT * distance, 1.0)
            total += (weight * np.exp(-2j * np.pi * phase)).sum()
        return complex(total)

    def strengths(
        self, offset: FloatArray, permittivity: complex | None = None
    ) -> Iterator[tuple[ComplexArray, FloatArray]]:
        """(point,) gains without the propagation phase, and distances [m], piece by piece.

        In backscattering the polarimetric obliquity is cos (r_s e_s^2 - r_p e_p^2), for the parts e_s, e_p of the field
        across and in the plane of incidence; `tests/benchmarks/test_bench.py` holds it against the reference's.
        """
        for first in range(0, len(self.points), CHUNK):
            piece = slice(first, first + CHUNK)
            place = self.points[piece] + offset
            distance = np.sqrt(np.einsum("pi,pi->p", place, place))
            towards = place / distance[:, None]
            cos = np.maximum(-np.einsum("pi,pi->p", towards, self.normal[piece]), 0.0)
            r_s, r_p = fresnel(self.permittivity if permittivity is None else permittivity, 1.0, cos)
            across = _share_across(towards, self.normal[piece], self.field)
            f = cos * (r_s * across - r_p * (1 - across))
            yield 1j / (4 * np.pi) * f * self.area[piece] / distance**2, distance


def _share_across(towards: FloatArray, normal: FloatArray, field: FloatArray) -> FloatArray:
    """(point,) share of the transverse field's energy that is across the plane of incidence."""
    s = np.cross(towards, normal)
    transverse = field - (towards @ field)[:, None] * towards
    size = np.einsum("pi,pi->p", s, s) * np.einsum("pi,pi->p", transverse, transverse)
    return np.asarray(np.einsum("pi,pi->p", s, transverse) ** 2 / np.maximum(size, 1e-30))


def _surface(place: FloatArray, corners: FloatArray, rises: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(point, 3) flat points, points of the quadratic surface, and its normals, twice its area long, at barycentric
    coordinates `place` (point, 3) of faces whose edges opposite their corners rise by `rises` (point, 3, 3)."""
    w = place[:, :, None]
    flat = (w * corners).sum(axis=1)
    point = flat + 4 * sum(w[:, (i + 1) % 3] * w[:, (i + 2) % 3] * rises[:, i] for i in range(3))
    slope = [
        corners[:, i] + 4 * (w[:, (i + 2) % 3] * rises[:, (i + 1) % 3] + w[:, (i + 1) % 3] * rises[:, (i + 2) % 3])
        for i in range(3)
    ]
    return flat, point, np.cross(slope[1] - slope[0], slope[2] - slope[0])


def _spread(corners: FloatArray) -> FloatArray:
    """(face,) largest difference of two corners' distances [m], but that of the flat part where it is head on."""
    distance = np.linalg.norm(corners, axis=2)
    middle = np.linalg.norm(corners.mean(axis=1), axis=1)
    bulge = 4 * np.abs(distance.mean(axis=1) - middle)
    return np.asarray(np.ptp(distance, axis=1) + bulge)


def _quartered(corners: FloatArray) -> FloatArray:
    a, b, c = (corners[:, i] for i in range(3))
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.concatenate([np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def errors(found: ComplexArray, expected: ComplexArray, free_phase: bool) -> dict[str, float]:
    """Root mean squares: the error relative to the level, in phase and in level; `free_phase` leaves a constant one."""
    ratio = np.asarray(found) / expected
    if free_phase and abs(ratio.mean()) > 0:
        ratio = ratio * np.exp(-1j * np.angle(ratio.mean()))
    level = np.abs(found) / np.abs(expected)
    return {
        "relative": float(np.sqrt(np.mean(np.abs(ratio - 1) ** 2))),
        "phase_deg": float(np.degrees(np.sqrt(np.mean(np.angle(ratio) ** 2)))),
        "level_db": float(np.sqrt(np.mean((20 * np.log10(np.maximum(level, 1e-6))) ** 2))),
    }
