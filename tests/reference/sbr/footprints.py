"""Integrals over where tubes land, for every element pair over the band.

A footprint is a curved triangle, known at its corners and at the middles of its edges: places, normals, path lengths
from every element and to it, fields. Over it places and path lengths are quadratic, and so is the strength

    a = (j / 4 pi) int F exp(-j k (L + R)) dS,    F = 1/2 [E . n x (g x k_out) + H . n x g]

with the total tangential fields E, H (incident and Fresnel-reflected) of the wave that came by way of the tube, and the
field g, 1 / R strong, that the other element would make there. Each of the two elements of a pair once sends by way of
the tube while the other one looks straight at the footprint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.kernels import drjit_types, exact_division, upload
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave, CurvedMirror
from rfgen_sionna.tracing.curved.media import polarisation_bases, reflected
from rfgen_sionna.tracing.integral.quadratic import lattice_triangle
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.simplex import moments
from tests.reference.sbr.hits import Hits
from tests.reference.sbr.media import SlabOptics
from tests.reference.sbr.passage import Slab, SlabRoute, arriving_wave, polarised_field

SAG = 0.03
"""Phase [rad] by which a part of a footprint may be bent: first order of it is kept."""
MOST_PARTS = 64
_GRAZING = 1e-4
"""Least cosine of incidence that areas are divided by."""
_EDGE = 1e-9
"""Directions so close to an edge of the octahedron lie on it."""
_LANES = 1 << 19
"""Integrals per launch."""
ENDS = ((1, 2), (2, 0), (0, 1))
"""Corners of the edge whose middle is node 3, 4, 5."""
_DERIVATIVES = np.array([  # (node, of the quadratic's value at node, along the second and the third corner)
    [[-3, -3], [-1, 0], [0, -1], [0, 0], [0, 4], [4, 0]],
    [[1, 1], [3, 0], [0, -1], [0, 4], [0, 0], [-4, -4]],
    [[1, 1], [-1, 0], [0, 3], [4, 0], [-4, -4], [0, 0]],
    [[1, 1], [1, 0], [0, 1], [2, 2], [-2, -2], [-2, -2]],
    [[-1, -1], [-1, 0], [0, 1], [2, 0], [-2, 0], [2, 0]],
    [[-1, -1], [1, 0], [0, -1], [0, 2], [0, 2], [0, -2]],
], dtype=np.float64)  # fmt: skip


@dataclass(frozen=True)
class Landed:
    """Footprints; lanes are footprint by footprint, six nodes each."""

    route: SlabRoute
    """By way of the tube."""
    back: SlabRoute
    """Straight to the radar."""
    normal: FloatArray
    """(lane, 3) unit, towards where the tube comes from."""
    surface: IntArray
    """(lane,)"""
    area: FloatArray
    """(lane,) area per area of the unit triangle's parameters [m^2]."""

    def __len__(self) -> int:
        return len(self.surface) // 6


@dataclass(frozen=True)
class Integrals:
    """One way of sending, of every footprint."""

    a: ComplexArray
    """(frequency, tx, rx, footprint) gain without the propagation phase of the middle."""
    tau: FloatArray
    """(tx, rx, footprint) delay by way of the middle [s]."""


def landed(hits: Hits, rows: NDArray[np.intp]) -> Landed:
    """Footprints whose nodes are `rows` (footprint, 6) of `hits`."""
    lane = rows.reshape(-1)
    mirrors: list[CurvedMirror] = []
    legs: list[list[Slab]] = [[]]
    row, own, chain = lane, hits, []
    while own.before is not None:
        row = own.parent[row]
        chain.append((own.before, row, own.through))
        own = own.before
    for each, at, through in reversed(chain):
        if through:
            legs[-1].append(Slab(each.normal[at], each.surface[at]))
        else:
            mirrors.append(CurvedMirror(each.point[at], each.normal[at], each.patch[at], each.surface[at]))
            legs.append([])
    start = own.ray[row] @ own.setting.rotation
    point = hits.point[lane]
    out = [
        Slab(hits.out_normal[lane, depth], hits.out[lane, depth])
        for depth in range(hits.out.shape[1])
        if (hits.out[lane, depth] >= 0).any()
    ]
    slopes = np.einsum("nmd,pmi->pndi", _DERIVATIVES, point.reshape(-1, 6, 3))
    area = lengths(np.cross(slopes[:, :, 0], slopes[:, :, 1]).reshape(-1, 3))
    # Where no mirror is bent, the area is known from the solid angle: on the octahedron directions are quadratic. On
    # round surfaces that holds off grazing incidence, where their normals are less certain than the places.
    place = start / np.abs(start).sum(axis=1, keepdims=True)
    slopes = np.einsum("nmd,pmi->pndi", _DERIVATIVES, place.reshape(-1, 6, 3)).reshape(-1, 2, 3)
    angle = np.abs(np.einsum("li,li->l", place, np.cross(slopes[:, 0], slopes[:, 1]))) / lengths(place) ** 3
    cos = np.abs(np.einsum("li,li->l", hits.ray[lane], hits.normal[lane]))
    by_angle = angle * hits.length[lane] ** 2 / np.maximum(cos, _GRAZING)
    share = np.where((hits.patch[lane] == 0).all(axis=(1, 2)), 1.0, np.clip(5.0 * cos - 1.0, 0.0, 1.0))
    # Tubes stay within a face of the octahedron, strips beside rims need not.
    sides = place.reshape(-1, 6, 3)
    folded = ((sides.min(axis=1) < -_EDGE) & (sides.max(axis=1) > _EDGE)).any(axis=1)
    share[np.repeat(folded, 6)] = 0.0
    for mirror in mirrors:
        share = np.where((mirror.curvature == 0).all(axis=(1, 2)), share, 0.0)
    area = share * by_angle + (1.0 - share) * area
    return Landed(
        SlabRoute(tuple(mirrors), point, tuple(tuple(each) for each in legs)),
        SlabRoute((), point, (tuple(out),)),
        hits.normal[lane],
        hits.surface[lane],
        area,
    )


@dataclass(frozen=True)
class _Wave:
    """What an element's wave by way of a tube makes of a surface: total tangential fields."""

    electric: ComplexArray
    magnetic: ComplexArray
    towards: FloatArray
    """(lane,) cosine of incidence; 0 or less has no return."""


@dataclass(frozen=True)
class _Look:
    """What an element that looks straight at the surface receives of each component of the fields."""

    of_electric: ComplexArray
    of_magnetic: ComplexArray
    facing: FloatArray


def integrate(
    found: Landed,
    optics: SlabOptics,
    tx: FloatArray,
    rx: FloatArray,
    fields: tuple[FloatArray, FloatArray],
    frequencies: Sequence[float],
) -> tuple[Integrals, Integrals | None]:
    """Gains of footprints for `tx` (tx, 3) and `rx` (rx, 3) [m] at `frequencies` [Hz]: with Tx and with Rx by way of
    the tube; None for the latter where that is the same place, straight ahead: the first holds the mean of both then.
    """
    count = len(found)
    direct = not found.route.mirrors
    elements = [*tx, *rx]
    by_tube = [arriving_wave(each, found.route, optics) for each in elements]
    straight = by_tube if direct else [arriving_wave(each, found.back, optics) for each in elements]
    first, last = slice(0, len(tx)), slice(len(tx), None)
    gains: list[list[ComplexArray]] = [[], []]
    there, back = _lengths(by_tube[first], straight[last], count), _lengths(straight[first], by_tube[last], count)
    for frequency in frequencies:
        field_of = [fields[0]] * len(tx) + [fields[1]] * len(rx)
        waves = [
            polarised_field(f, each, found.route, optics, frequency) for f, each in zip(field_of, by_tube, strict=True)
        ]
        occluders = waves
        if not direct:
            occluders = [polarised_field(f, each, found.back, optics, frequency)
                     for f, each in zip(field_of, straight, strict=True)]  # fmt: skip
        made = [_wave(found, optics, *each, frequency) for each in zip(waves, by_tube, strict=True)]
        visible = [_visibility(found, *each) for each in zip(occluders, straight, strict=True)]
        strength = [_strengths(made[first], visible[last]), _strengths(made[last], visible[first]).swapaxes(0, 1)]
        k = 2 * np.pi * frequency / SPEED_OF_LIGHT
        if direct:
            strength = [0.5 * (strength[0] + strength[1])]
        for each, ways, values in zip(gains, (there, back), strength, strict=False):
            each.append(_mean(k, ways, (values * found.area).reshape(*values.shape[:2], count, 6)))
    results = [
        Integrals(np.stack(each) * (0.5j / (4 * np.pi)), _middle(ways) / SPEED_OF_LIGHT)
        for each, ways in zip(gains, (there, back), strict=True)
        if each
    ]
    return results[0], None if direct else results[1]


def _lengths(one: Sequence[ArrivingWave], other: Sequence[ArrivingWave], count: int) -> FloatArray:
    """(tx, rx, footprint, 6) [m]"""
    tx, rx = (np.stack([each.length for each in part]).reshape(len(part), count, 6) for part in (one, other))
    return np.asarray(tx[:, None] + rx)


def _middle(values: NDArray[Any]) -> NDArray[Any]:
    """Of quadratics (..., 6) in the middle of the triangle."""
    return np.asarray(4 / 9 * values[..., 3:].sum(axis=-1) - values[..., :3].sum(axis=-1) / 9)


def _wave(found: Landed, optics: SlabOptics, field: ComplexArray, arrival: ArrivingWave, frequency: float) -> _Wave:
    cos, _, _ = polarisation_bases(arrival.ray, found.normal)
    pair = optics.reflection(found.surface, cos, frequency)
    after, ray = reflected(field, arrival.ray, found.normal, *pair)
    magnetic = np.cross(arrival.ray, field) + np.cross(ray, after)
    return _Wave(field + after, magnetic, -np.einsum("li,li->l", arrival.ray, found.normal))


def _visibility(found: Landed, field: ComplexArray, arrival: ArrivingWave) -> _Look:
    away = -arrival.ray
    return _Look(
        np.cross(found.normal, np.cross(field, away)),
        np.cross(found.normal, field),
        np.einsum("li,li->l", away, found.normal),
    )


def _strengths(waves: Sequence[_Wave], occluders: Sequence[_Look]) -> ComplexArray:
    """(wave, look, lane) F"""
    found = np.empty((len(waves), len(occluders), len(waves[0].towards)), np.complex128)
    for i, wave in enumerate(waves):
        for j, sampler in enumerate(occluders):
            value = np.einsum("li,li->l", wave.electric, sampler.of_electric)
            value += np.einsum("li,li->l", wave.magnetic, sampler.of_magnetic)
            found[i, j] = np.where((wave.towards > 0) & (sampler.facing > 0), 0.5 * value, 0.0)
    return found


def _mean(k: float, ways: FloatArray, strength: ComplexArray) -> ComplexArray:
    """(...,) means over triangles of quadratic strengths times exp(-j k (length - that of the middle)), from values
    (..., 6) at their nodes."""
    shape = ways.shape[:-1]
    phase = (k * (ways - _middle(ways)[..., None])).reshape(-1, 6)
    strength = strength.reshape(-1, 6)
    length_sagittas = np.stack([0.5 * (phase[:, i] + phase[:, j]) - phase[:, 3 + m] for m, (i, j) in enumerate(ENDS)])
    parts = np.clip(np.ceil(np.sqrt(np.abs(length_sagittas).max(axis=0, initial=0.0) / SAG)), 1, MOST_PARTS).astype(
        np.uint32
    )
    out = np.zeros(len(phase), np.complex128)
    order = np.argsort(parts, kind="stable")  # alike ones side by side
    order = order[np.abs(strength[order]).max(axis=1, initial=0.0) > 0]
    for start in range(0, len(order), _LANES):
        lane = order[start : start + _LANES]
        out[lane] = _launch(phase[lane], strength[lane], parts[lane])
    return out.reshape(shape)


@exact_division()
def _launch(phase: FloatArray, strength: ComplexArray, parts: NDArray[np.uint32]) -> ComplexArray:
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    psi = [upload(Float, phase[:, node]) for node in range(6)]
    strengths = [
        ComplexPair(upload(Float, strength[:, node].real), upload(Float, strength[:, node].imag)) for node in range(6)
    ]
    count = upload(UInt32, parts)
    scale = 1.0 / Float(count)

    def shapes(w: tuple[Any, Any, Any]) -> list[Any]:
        return [each * (2.0 * each - 1.0) for each in w] + [4.0 * w[i] * w[j] for i, j in ENDS]

    def at(w: tuple[Any, Any, Any]) -> tuple[Any, ComplexPair]:
        values = shapes(w)
        length, total = values[0] * psi[0], strengths[0].scaled(values[0])
        for node in range(1, 6):
            length = length + values[node] * psi[node]
            total = total + strengths[node].scaled(values[node])
        return length, total

    def step(index: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
        row, column, turned, last = lattice_triangle(dr, Float(index))
        rows, columns = [row, row + 1.0, last], [column, dr.select(turned, column + 1.0, column), column + 1.0]
        w = [(1.0 - r * scale, (r - c) * scale, c * scale) for r, c in zip(rows, columns, strict=True)]
        ends = [at(each) for each in w]
        middles = [at(tuple(0.5 * (w[i][n] + w[j][n]) for n in range(3))) for i, j in ENDS]
        found = moments(dr, tuple(length for length, _ in ends))
        mean = (ends[0][1] + ends[1][1] + ends[2][1]).scaled(1.0 / 3.0)
        sag = [0.5 * (ends[i][0] + ends[j][0]) - middles[m][0] for m, (i, j) in enumerate(ENDS)]
        offset = (sag[0] + sag[1] + sag[2]) / 3.0
        bent = found.mean.scaled(-offset)
        for m in range(3):
            bent = bent + found.edge[m].scaled(4.0 * sag[m])
        total = mean.times(found.mean + bent.turned())
        for m, (i, j) in enumerate(ENDS):
            total = total + (ends[m][1] - mean).times(found.corner[m])
            rise = middles[m][1] - (ends[i][1] + ends[j][1]).scaled(0.5)
            total = total + rise.times(found.edge[m]).scaled(4.0)
        sin, cos = dr.sincos(offset)
        total = total.times(ComplexPair(cos, sin)).scaled(scale * scale)
        return index + 1, re + total.re, im + total.im

    width = len(parts)
    last = count * count
    start = (dr.zeros(UInt32, width), dr.zeros(Float, width), dr.zeros(Float, width))
    _, re, im = dr.while_loop(start, lambda index, re, im: index < last, step)
    dr.eval(re, im)
    out = np.empty(width, np.complex128)
    out.real, out.imag = re.numpy(), im.numpy()
    return out
