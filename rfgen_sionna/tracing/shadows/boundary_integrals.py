"""Integrals between shadow boundaries of the phase centre and of element pairs, in float64 on Dr.Jit (LLVM or CUDA).

One lane per edge and pair. Across the boundary Gauss quadrature follows the phase; along it the integral has a closed
form for parts of linear phase.

Let S(x) be the integral from the phase centre's boundary to x, towards the visible side, and n and f the boundaries of
the two elements, f the further. Behind an opaque occluder a pair has S(f) less than the centre. Behind a slab with
amplitude transmission t one way and t' two ways it has (1 - t) S(f) + (t - t') S(n) less.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.tracing.shadows.boundary_edges import MAX_SLANT, ShadowEdges

_ACROSS = (0.15, 1.0, 4.0, 12.0, 28.0)
"""Largest phase range across the boundary [rad] for 1, 2, 4 … Gauss points."""
_RULES = [np.polynomial.legendre.leggauss(2**k) for k in range(len(_ACROSS) + 1)]
"""Gauss-Legendre rules of 1, 2, 4 … points."""
_POINTS = np.concatenate([np.column_stack([0.5 + 0.5 * place, 0.5 * weight]) for place, weight in _RULES])
"""(point, 2) abscissas in 0 … 1 and weights; the rule of 2^k points begins at 2^k - 1."""
_MAX_ARCH = 0.03
"""Largest quadratic phase of a part between its middle and its ends [rad]: 30 dB below its return."""
_MOST_PARTS = 64.0
"""Most parts along an edge; bounds the time of a lane."""
_MOST_SKEW = 3.0
"""Largest skew of a boundary's ends, metres along per metre across: beyond it the edge points at the viewpoint."""


def boundary_gains(
    edges: ShadowEdges,
    tx: FloatArray,
    rx: FloatArray,
    centre: float,
    half_band: float,
    gains: ComplexArray,
    reference: FloatArray,
) -> ComplexArray:
    """(order, tx, rx, edge) corrections: gains of each pair minus those of the viewpoint, as polynomials over the band
    [Hz].

    `tx` and `rx` (element, 3) and the delays' reference points `reference` (edge, 3) are from the viewpoint [m],
    `gains` (order, tx, rx, edge) those of the edges' small pieces.
    """
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    count = int(np.prod(gains.shape[1:]))
    if not count:
        return gains.copy()
    surface = np.concatenate([edges.tangents, edges.edge_curvature], axis=1).transpose(1, 0, 2)
    vectors = edges.middle, edges.inward, edges.normal, *surface, reference
    scalars = edges.length, edges.occluder, edges.band, edges.next_occluder, -edges.weight / edges.area
    through = bool(edges.through.any())
    found = dr.empty(Float, 2 * gains.size)
    given = {
        "lanes": dr.arange(UInt32, count),
        "edges": dr.opaque(UInt32, len(edges.owner)),
        "transmitters": dr.opaque(UInt32, len(tx)),
        "receivers": dr.opaque(UInt32, len(rx)),
        "count": dr.opaque(UInt32, count),
        "elements": upload(Float, np.concatenate([tx, rx])),
        "band": upload(Float, np.array([centre, half_band])),
        "points": upload(Float, _POINTS),
        "vectors": upload(Float, np.concatenate([each.T for each in vectors])),
        "scalars": upload(Float, np.stack(scalars)),
        "gains": upload(Float, gains.view(np.float64)),
        "found": found,
    }
    if through:
        given["shares"] = upload(Float, _shares(edges.through).view(np.float64))
    _BOUNDARY_GAINS(given, len(gains), through)
    return np.asarray(found.numpy()).view(np.complex128).reshape(gains.shape)


def _shares(through: ComplexArray) -> ComplexArray:
    """(strip, power, edge) polynomial weights of S(f) and S(n), for the transmission `through` (edge, 2, 3)."""
    once, twice = through[:, 0], through[:, 1]
    low, middle, high = np.stack([1.0 - once, once - twice]).transpose(2, 0, 1)
    return np.ascontiguousarray(np.stack([middle, 0.5 * (high - low), 0.5 * (high + low) - middle], axis=1))


def _integrate_boundaries(given: dict[str, Any], orders: int, through: bool) -> None:
    """Kernel of :func:`boundary_gains`; `through` includes slab transmission."""
    dr, types = drjit_types()
    Float, UInt32, Array3 = types.Float64, types.UInt32, types.Array3f64
    lane, edges, receivers, count = (given[name] for name in ("lanes", "edges", "receivers", "count"))
    edge, pair = lane % edges, lane // edges
    centre, half_band = (dr.gather(Float, given["band"], UInt32(k)) for k in range(2))
    wavenumber = centre * (2 * np.pi / SPEED_OF_LIGHT)

    def element(index: Any) -> Any:
        return Array3(*(dr.gather(Float, given["elements"], 3 * index + axis) for axis in range(3)))

    def vector(number: int) -> Any:
        return Array3(*(dr.gather(Float, given["vectors"], (3 * number + axis) * edges + edge) for axis in range(3)))

    ends = element(pair // receivers), element(given["transmitters"] + pair % receivers)
    middle, inward, normal, across, along, edge_curvature, arch, twist, reference = (vector(k) for k in range(9))
    length, occluder, band, next_occluder, share = (
        dr.gather(Float, given["scalars"], k * edges + edge) for k in range(5)
    )

    def moved(middle: Any, inward: Any, occluder: Any) -> tuple[Any, Any]:
        """The further and the nearer boundary of both ends."""
        height, there = dr.dot(normal, middle), dr.dot(inward, middle)
        indirect, nearer = Float(-dr.inf), Float(dr.inf)
        for each in ends:
            own, here = dr.dot(normal, each), dr.dot(inward, each)
            below = occluder * height - own
            on = (height - own) * occluder / dr.select(abs(below) > 1e-12, below, 1e-12)
            on = dr.clip(on, 1.0 / MAX_SLANT, MAX_SLANT) / dr.maximum(occluder, 1e-6)
            # From the element through the occluder, `on` times as far.
            own = here + on * (occluder * there - here) - there
            indirect, nearer = dr.maximum(indirect, own), dr.minimum(nearer, own)
        return indirect, nearer

    width, nearer = moved(middle, inward, occluder)
    # No pair sees less than nothing of a narrow visible band: half of the excess is cut here, half at its other edge.
    ended = dr.isfinite(band)
    far = dr.select(ended, band, 0.0)
    left = far - width - moved(middle + far * inward, -inward, dr.select(ended, next_occluder, 1.0))[0]
    width = width + dr.select(ended, 0.5 * dr.minimum(left, 0.0), 0.0)

    # Ends run across as seen from the viewpoint, so that neighbours meet.
    visible = middle / dr.maximum(dr.norm(middle), 1e-9)
    ahead = dr.dot(along, visible)
    skew = dr.dot(across, visible) * ahead - dr.dot(across, along)
    skew = dr.clip(skew / dr.maximum(dr.dot(along, along) - ahead * ahead, 1e-9), -_MOST_SKEW, _MOST_SKEW)
    across, edge_curvature, twist = (
        across + skew * along,
        edge_curvature + skew * (2.0 * twist + skew * arch),
        twist + skew * arch,
    )

    turn, turned, sagitta_error, arched, twisted, way = (Float(0.0) for _ in range(6))
    cycles = Float(0.0)
    for each in ends:
        offset = middle - each
        distance = dr.maximum(dr.norm(offset), 1e-9)
        towards = offset / distance
        slope, sloped = dr.dot(towards, across), dr.dot(towards, along)
        turn, turned = turn + wavenumber * slope, turned + wavenumber * sloped
        sagitta_error = sagitta_error + wavenumber * (
            (dr.dot(across, across) - slope * slope) / distance + dr.dot(towards, edge_curvature)
        )
        arched = arched + wavenumber * ((dr.dot(along, along) - sloped * sloped) / distance + dr.dot(towards, arch))
        twisted = twisted + wavenumber * ((dr.dot(across, along) - slope * sloped) / distance + dr.dot(towards, twist))
        # From the edge's middle to the delays' reference point.
        own = (dr.norm(offset) - dr.norm(reference - each)) / SPEED_OF_LIGHT
        way, cycles = way + own, cycles + (centre * own - dr.floor(centre * own))

    def strip(width: Any) -> Any:
        """Integral up to `width`, over that of the small piece."""
        spread = abs(turn * width) + 0.5 * abs(sagitta_error) * width * width
        kind = UInt32(0)
        for limit in _ACROSS:
            kind = kind + dr.select(spread > limit, UInt32(1), UInt32(0))
        many = UInt32(1) << kind
        parts = dr.clip(dr.ceil(length * dr.sqrt(abs(arched) / (8.0 * _MAX_ARCH))), 1.0, _MOST_PARTS)
        half = 0.5 * length / parts

        def step(number: Any, real: Any, imaginary: Any) -> tuple[Any, Any, Any]:
            # Points across vary fastest, then parts along.
            place, weight = (
                dr.gather(Float, given["points"], 2 * (many - 1 + (number & (many - 1))) + k) for k in range(2)
            )
            off, at = place * width, (2.0 * Float(number >> kind) + 1.0) * half - 0.5 * length
            along = (turned + arched * at + twisted * off) * half
            straight = dr.select(abs(along) > 1e-6, dr.sin(along) / dr.select(abs(along) > 1e-6, along, 1.0), 1.0)
            sin, cos = dr.sincos(
                -off * (turn + 0.5 * sagitta_error * off) - at * (turned + 0.5 * arched * at + twisted * off)
            )
            return number + 1, real + weight * straight * cos, imaginary + weight * straight * sin

        total = many * UInt32(parts)
        start = dr.zeros(UInt32, dr.width(lane)), dr.zeros(Float, dr.width(lane)), dr.zeros(Float, dr.width(lane))
        found = types.Complex2f64(*dr.while_loop(start, lambda number, *_: number < total, step)[1:])
        sin, cos = dr.sincos(-2 * np.pi * (cycles - dr.floor(cycles)))
        return (share * width * length / parts) * found * types.Complex2f64(cos, sin)

    factors = [strip(width)]
    if through:  # a polynomial over the band
        both = factors[0], strip(dr.minimum(nearer, width))

        def shares(which: int, power: int) -> Any:
            first = 2 * ((3 * which + power) * edges + edge)
            return types.Complex2f64(*(dr.gather(Float, given["shares"], first + k) for k in range(2)))

        factors = [sum(shares(k, power) * both[k] for k in range(2)) for power in range(min(orders, 3))]
    own_gains = [
        types.Complex2f64(*(dr.gather(Float, given["gains"], 2 * (order * count + lane) + k) for k in range(2)))
        for order in range(orders)
    ]
    powers = [types.Complex2f64(1.0, 0.0)]
    for order in range(1, orders):
        powers.append(powers[-1] * types.Complex2f64(0.0, -2 * np.pi * half_band * way / order))
    nothing, by_way = types.Complex2f64(0.0, 0.0), []
    for order in range(orders):
        by_way.append(sum((powers[k] * own_gains[order - k] for k in range(order + 1)), nothing))
    for order in range(orders):
        total = by_way[order] * factors[0]
        for k in range(1, min(len(factors), order + 1)):
            total = total + by_way[order - k] * factors[k]
        for k, value in enumerate((total.real, total.imag)):
            dr.scatter(given["found"], value, 2 * (order * count + lane) + k, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_BOUNDARY_GAINS = FrozenKernel(_integrate_boundaries)
