"""What the benchmark holds answers against: series, closed forms, image theory, dense quadrature."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.surface.quadratic_patch import edge_sagittas
from rfgen_sionna.tracing.surface.smoothing import find_smoothing
from tests.reference.physical_optics import fresnel, triangle_points

CHUNK = 1 << 18
"""Points at a time."""
VERSION = 1
"""Of the quadrature: a change that moves its answers takes the next number."""
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
class Probe:
    """One integral: the sum over the surface of strength times exp(-j 2 pi (linear R + square R^2)) for distances R."""

    offset: tuple[float, float, float]
    """By how much all is moved [m]: small against what changes visibility."""
    linear: float
    """[1/m]"""
    square: float = 0.0
    """[1/m^2]"""
    permittivity: complex | None = None
    """None is that of the middle of the band."""

    @classmethod
    def channel(cls, offset: FloatArray, frequency: float) -> Probe:
        x, y, z = (float(each) for each in offset)
        return cls((x, y, z), 2 * frequency / SPEED_OF_LIGHT)


@dataclass(frozen=True)
class Points:
    """Some points of the visible surface."""

    points: FloatArray
    """(point, 3) from the viewpoint [m]."""
    normal: FloatArray
    """(point, 3) unit."""
    area: FloatArray
    """(point,) [m^2]."""


@dataclass(frozen=True)
class Quadrature:
    """Physical optics of a mesh from its definition: Gauss-Legendre points on each face that faces the radar, as many
    as the phase over it asks for, each with its own obliquity, distance and visibility. One element sends and receives.

    At 77 GHz a person takes four million points and a car ninety: they are gone through piece by piece.
    """

    vertices: FloatArray
    faces: IntArray
    viewpoint: FloatArray
    frequency: float
    permittivity: complex
    field: FloatArray
    """(3,) direction of the element's field."""
    rays: Callable[[], RayScene] | None
    """Tells what hides points; None: nothing does."""
    first_facet: int = 0
    """Number of the mesh's face 0 in `rays`."""
    oversampling: float = 1.0
    """Multiplies the density of the points."""
    smooth: bool = False
    """Whether the quadratic surface through the corners and the middles of bowed edges is integrated: where that is, is
    the package's to define (:mod:`rfgen_sionna.tracing.surface.smoothing`); what it returns is found here. What hides
    its
    points is the flat mesh."""

    @cached_property
    def sagittas(self) -> FloatArray | None:
        """(face, 3, 3) of the edges; None where all is flat."""
        found = find_smoothing(self.vertices, self.faces) if self.smooth else None
        corners = self.vertices[self.faces] - self.viewpoint
        return None if found is None else edge_sagittas(corners, found.normals(self.vertices, self.faces))

    def pieces(self) -> Iterator[Points]:
        """The visible points, with the viewpoint at the origin."""
        corners, sagittas = self.vertices[self.faces] - self.viewpoint, self.sagittas
        rays = None if self.rays is None else self.rays()
        crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        for place, weight, number in self._places(corners, crosses):
            if sagittas is None:
                flat = point = np.einsum("pc,pci->pi", place, corners[number])
                cross = crosses[number]
            else:
                flat, point, cross = _surface(place, corners[number], sagittas[number])
            targets, owner = flat + self.viewpoint, number + self.first_facet
            visible = slice(None) if rays is None else ~rays.occluded(self.viewpoint, targets, owner)
            twice = np.linalg.norm(cross, axis=1)
            yield Points(point[visible], (cross / twice[:, None])[visible], (0.5 * twice * weight)[visible])

    def _places(self, corners: FloatArray, crosses: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
        """(point, 3) barycentric coordinates, (point,) shares of the face's area, (point,) faces."""
        face = np.flatnonzero((crosses * corners[:, 0]).sum(axis=1) < 0)
        parts = np.broadcast_to(np.eye(3), (len(face), 3, 3))
        wavenumber = 2 * np.pi * self.frequency / SPEED_OF_LIGHT * self.oversampling
        while len(face):
            # Gauss-Legendre needs two points per wavelength of the path and some more; the collapsed square has its
            # long side along an edge.
            wanted = POINTS[0] + 2 * wavenumber * _spread(parts @ corners[face]) / np.pi
            fine = wanted <= POINTS[-1]
            chosen = np.searchsorted(POINTS, wanted)
            for index, count in enumerate(POINTS):
                local, weight = triangle_points(np.eye(3)[None], count)
                group = np.flatnonzero(fine & (chosen == index))
                for some in np.array_split(group, -(-len(group) * len(weight) // CHUNK)) if len(group) else ():
                    share = np.abs(np.linalg.det(parts[some]))  # of the face's area
                    place = (local @ parts[some]).reshape(-1, 3)
                    yield place, np.outer(share, weight).ravel(), np.repeat(face[some], len(weight))
            face, parts = np.tile(face[~fine], 4), _quartered(parts[~fine])

    def sums(self, probes: Sequence[Probe]) -> ComplexArray:
        """(probe,) the integrals."""
        total = np.zeros(len(probes), np.complex128)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for piece in self.pieces():
                total += list(pool.map(lambda probe, piece=piece: self._sum(probe, piece), probes))  # type: ignore[misc]
        return total

    def _sum(self, probe: Probe, piece: Points) -> complex:
        """In backscattering the polarimetric obliquity is cos (r_s e_s^2 - r_p e_p^2), for the parts e_s, e_p of the
        field across and in the plane of incidence; `tests/benchmarks/test_truth.py` holds it against the
        reference's."""
        place = piece.points + np.array(probe.offset)
        distance = np.sqrt(np.einsum("pi,pi->p", place, place))
        cos = np.maximum(-np.einsum("pi,pi->p", place, piece.normal) / distance, 0.0)
        permittivity = self.permittivity if probe.permittivity is None else probe.permittivity
        weight: Any = -cos  # metal: r_s = -1, r_p = 1
        if np.isfinite(permittivity):
            r_s, r_p = fresnel(permittivity, 1.0, cos)
            across = _share_across(place / distance[:, None], piece.normal, self.field)
            weight = cos * (r_s * across - r_p * (1 - across))
        turns = np.mod(distance * (probe.linear + probe.square * distance), 1.0)
        return complex(1j / (4 * np.pi) * (weight * piece.area / distance**2 * np.exp(-2j * np.pi * turns)).sum())


def _share_across(towards: FloatArray, normal: FloatArray, field: FloatArray) -> FloatArray:
    """(point,) share of the transverse field's energy that is across the plane of incidence."""
    s = np.cross(towards, normal)
    transverse = field - (towards @ field)[:, None] * towards
    size = np.einsum("pi,pi->p", s, s) * np.einsum("pi,pi->p", transverse, transverse)
    return np.asarray(np.einsum("pi,pi->p", s, transverse) ** 2 / np.maximum(size, 1e-30))


def _surface(place: FloatArray, corners: FloatArray, sagittas: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(point, 3) flat points, points of the quadratic surface, and its normals, twice its area long, at barycentric
    coordinates `place` (point, 3) of faces whose edges opposite their corners rise by `sagittas` (point, 3, 3)."""
    w = place[:, :, None]
    flat = (w * corners).sum(axis=1)
    point = flat + 4 * sum(w[:, (i + 1) % 3] * w[:, (i + 2) % 3] * sagittas[:, i] for i in range(3))
    slope = [
        corners[:, i]
        + 4 * (w[:, (i + 2) % 3] * sagittas[:, (i + 1) % 3] + w[:, (i + 1) % 3] * sagittas[:, (i + 2) % 3])
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
