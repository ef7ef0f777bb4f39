"""Wave of an element at a point, after curved mirrors.

Rays start at the phase centre; elements are displaced from it. The path of an element to the same point follows from
Fermat's principle: its length is stationary over the points on the mirrors, each the osculating quadric at the ray's
reflection point. The second derivatives of the length L give the spreading,

    |E| = |det d^2 L / de dx|^(1/2)

over directions across the path at the element e and the point x (Van Vleck's determinant; 1 / R without mirrors). Each
negative eigenvalue of the Hessian over the mirrors is a passed focus and turns the phase by a quarter (Morse index).

Source: V. Cerveny, Seismic Ray Theory (2001), sections 4.10 to 4.12; J. B. Keller's geometrical optics.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths, unit
from rfgen_sionna.tracing.curved.media import SurfaceOptics, polarisation_bases, reflected

STEPS = 3
"""Newton steps: elements are centimetres from the phase centre, and each step squares the error."""
MAX_FOCUSING = 1.0
"""Bound of the spreading near a focus, times sqrt(1 / (wavelength x length)): diffraction limits it."""


@dataclass(frozen=True)
class CurvedMirror:
    """Reflection points with local curvature."""

    point: FloatArray
    """(lane, 3) [m]"""
    normal: FloatArray
    """(lane, 3) unit, towards the incident ray."""
    curvature: FloatArray
    """(lane, 3, 3) change of the normal along the surface [1/m]."""
    surface: IntArray
    """(lane,)"""


@dataclass(frozen=True)
class CurvedRoute:
    """Paths from the phase centre to points."""

    mirrors: tuple[CurvedMirror, ...]
    point: FloatArray
    """(lane, 3) [m]"""


@dataclass(frozen=True)
class ArrivingWave:
    """An element's wave at points; its phase is of `length` and of the field."""

    length: FloatArray
    """(lane,) of the path [m]."""
    ray: FloatArray
    """(lane, 3) unit direction of arrival."""
    spread: ComplexArray
    """(lane,) spreading [1/m], quarter turns included."""
    legs: tuple[FloatArray, ...]
    """Unit vectors (lane, 3) of the legs."""
    normals: tuple[FloatArray, ...]
    """Normals (lane, 3) of the mirrors at the reflection points."""
    hessian: FloatArray
    """(lane, 2 m, 2 m) second derivatives of the length [1/m] over the points on m mirrors, along their `tangents`."""


def arriving_wave(element: FloatArray, route: CurvedRoute, optics: SurfaceOptics) -> ArrivingWave:
    """Wave at the route's points of an `element` (3,), or of one per point (lane, 3) [m]."""
    mirrors, end = route.mirrors, route.point
    legs: tuple[FloatArray, ...]
    normals: tuple[FloatArray, ...]
    start, hessian = np.broadcast_to(element, end.shape), np.zeros((len(end), 0, 0))
    if not mirrors:
        offset = end - start
        reach = np.maximum(lengths(offset), 1e-4)
        legs, normals, spread = (offset / reach[:, None],), (), (1.0 / reach).astype(np.complex128)
        length = reach
    else:
        axes = [tangents(mirror.normal) for mirror in mirrors]
        curvatures = [t.transpose(0, 2, 1) @ m.curvature @ t for t, m in zip(axes, mirrors, strict=True)]
        place = [np.zeros((len(end), 2)) for _ in mirrors]
        for step in range(STEPS + 1):
            points = [start]
            slopes: list[FloatArray] = []
            for mirror, t, curvature, u in zip(mirrors, axes, curvatures, place, strict=True):
                turn = np.einsum("lab,lb->la", curvature, u)
                rise = -0.5 * np.einsum("la,la->l", turn, u)
                points.append(mirror.point + np.einsum("lia,la->li", t, u) + rise[:, None] * mirror.normal)
                slopes.append(t - mirror.normal[:, :, None] * turn[:, None, :])
            points.append(end)
            spans = [b - a for a, b in pairwise(points)]
            reach_of = [np.maximum(lengths(span), 1e-6) for span in spans]
            legs = tuple(span / reach[:, None] for span, reach in zip(spans, reach_of, strict=True))
            across = [
                (np.eye(3) - d[:, :, None] * d[:, None, :]) / reach[:, None, None]
                for d, reach in zip(legs, reach_of, strict=True)
            ]
            gradient, hessian = _derivatives(mirrors, slopes, curvatures, legs, across)
            if step == STEPS:
                break
            shift = np.linalg.solve(_regular(hessian), -gradient[..., None])[..., 0]
            # The quadric holds near its point: steps stay within a share of the shortest leg.
            limit = 0.3 * np.minimum.reduce(reach_of)
            shift *= np.minimum(1.0, limit / np.maximum(np.sqrt((shift**2).sum(axis=1)), 1e-30))[:, None]
            place = [u + shift[:, 2 * i : 2 * i + 2] for i, u in enumerate(place)]
        normals = tuple(
            _between(*both, unit(mirror.normal + np.einsum("lia,lab,lb->li", t, curvature, u)))
            for both, mirror, t, curvature, u in zip(pairwise(legs), mirrors, axes, curvatures, place, strict=True)
        )
        length = np.add.reduce(reach_of)
        spread = _spread(hessian, slopes, legs, across, length, optics)
    return ArrivingWave(length, legs[-1], spread, legs, normals, hessian)


def polarised_field(
    field: FloatArray, arrival: ArrivingWave, route: CurvedRoute, optics: SurfaceOptics, frequency: float
) -> ComplexArray:
    """(lane, 3) complex field at the points, without the phase of the length, for an element with field direction
    `field` (3,) of unit strength at 1 m in all directions; `frequency` [Hz]."""
    first = arrival.legs[0]
    across = field - (first @ field)[:, None] * first
    found = (across / np.maximum(lengths(across), 1e-9)[:, None]).astype(np.complex128)
    for mirror, leg, normal in zip(route.mirrors, arrival.legs, arrival.normals, strict=False):
        cos, _, _ = polarisation_bases(leg, normal)
        pair = optics.reflection(mirror.surface, cos, frequency)
        found, _ = reflected(found, leg, normal, *pair)
    return np.asarray(found * arrival.spread[:, None])


def _derivatives(
    mirrors: tuple[CurvedMirror, ...],
    slopes: list[FloatArray],
    curvatures: list[FloatArray],
    legs: tuple[FloatArray, ...],
    across: list[FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Gradient (lane, 2 m) and Hessian (lane, 2 m, 2 m) of the path length over the points on m mirrors."""
    count, lanes = len(mirrors), len(legs[0])
    gradient, hessian = np.zeros((lanes, 2 * count)), np.zeros((lanes, 2 * count, 2 * count))
    for i, (mirror, slope, curvature) in enumerate(zip(mirrors, slopes, curvatures, strict=True)):
        own = slice(2 * i, 2 * i + 2)
        turn = legs[i] - legs[i + 1]
        gradient[:, own] = np.einsum("li,lia->la", turn, slope)
        hessian[:, own, own] = slope.transpose(0, 2, 1) @ (across[i] + across[i + 1]) @ slope
        hessian[:, own, own] -= np.einsum("li,li->l", turn, mirror.normal)[:, None, None] * curvature
        if i + 1 < count:
            after = slice(2 * i + 2, 2 * i + 4)
            hessian[:, own, after] = -slope.transpose(0, 2, 1) @ across[i + 1] @ slopes[i + 1]
            hessian[:, after, own] = hessian[:, own, after].transpose(0, 2, 1)
    return gradient, hessian


def _between(one: FloatArray, other: FloatArray, normal: FloatArray) -> FloatArray:
    """(lane, 3) unit normals that reflect `one` to `other`; at grazing incidence the surface's `normal`. Reciprocal,
    where the surface's own normal is inexact near a caustic."""
    turn = other - one
    size = lengths(turn)[:, None]
    return np.where(size > 1e-6, turn / np.maximum(size, 1e-300), normal)


def _spread(
    hessian: FloatArray,
    slopes: list[FloatArray],
    legs: tuple[FloatArray, ...],
    across: list[FloatArray],
    length: FloatArray,
    optics: SurfaceOptics,
) -> ComplexArray:
    count = len(slopes)
    at_start = -across[0] @ slopes[0]  # (lane, 3, 2): d^2 L / de du_1
    at_end = -across[-1] @ slopes[-1]
    right = np.zeros((len(length), 2 * count, 3))
    right[:, 2 * count - 2 :] = at_end.transpose(0, 2, 1)
    mixed = -at_start @ np.linalg.solve(_regular(hessian), right)[:, :2]
    one, other = tangents(legs[0]), tangents(legs[-1])
    small = one.transpose(0, 2, 1) @ mixed @ other
    size = np.sqrt(np.abs(small[:, 0, 0] * small[:, 1, 1] - small[:, 0, 1] * small[:, 1, 0]))
    wavelength = SPEED_OF_LIGHT / optics.centre
    size = np.minimum(size, MAX_FOCUSING / np.sqrt(wavelength * length))
    turns = (np.linalg.eigvalsh(hessian) < 0).sum(axis=1)
    return np.asarray(size * 1j**turns)


def _regular(hessian: FloatArray) -> FloatArray:
    """The Hessian with a small diagonal against singularity."""
    size = np.abs(hessian).max(axis=(1, 2), initial=1e-12)
    eye = np.eye(hessian.shape[1])
    return np.asarray(hessian + (1e-12 * size + 1e-12)[:, None, None] * eye)


def tangents(normal: FloatArray) -> FloatArray:
    """(lane, 3, 2) two unit vectors across each `normal` (lane, 3) and each other."""
    helper = np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    one = unit(np.cross(helper, normal))
    return np.stack([one, np.cross(normal, one)], axis=2)
