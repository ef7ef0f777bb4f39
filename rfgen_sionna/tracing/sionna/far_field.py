"""Far-field scattering of a mesh or its pieces by physical optics, as Sionna's sensing uses it.

With unit vectors k_i and k_s along the incident and scattered wave, the scattering matrix about p is

    J = j sqrt(4 pi) / lambda  sum_facets  F A <exp(-j k (k_i - k_s) . (x - p))>

with the polarimetric obliquity F of :mod:`rfgen_sionna.tracing.integral.obliquity`, area A and the facet's mean, which
has a closed form. At long range a gain of the tracer, a = (j / 4 pi) F A <...> / (R_t R_r), is lambda J / ((4 pi)^(3/2)
R_t R_r), as for Sionna's Jones matrix; sum |J|^2 / 2 is the radar cross-section [m^2].

Needs a Mitsuba variant (:func:`rfgen_sionna.scene.mitsuba_backend.ensure_backend`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.kernels import drjit_types
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.ray_layer import MeshLayer
from rfgen_sionna.tracing.integral.obliquity import Media, ScatteredWave, media_of_lanes, media_tables
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.simplex import moments

_CLEARANCE = 1e-5
"""Start of shadow rays off the surface, over the mesh's size: above single-precision rounding."""
_GUIDE_POINTS = ((2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3))
"""Barycentric coordinates of three visibility rays, one near each corner."""


class ScatteringMesh:
    """Mesh of one material with its facets in the order of their pieces."""

    def __init__(
        self, vertices: FloatArray, faces: IntArray, piece: IntArray, material: Material, frequency: Callable[[], float]
    ) -> None:
        """`vertices` (vertex, 3) [m] in the target's frame; `piece` (face,) is ascending; `frequency` returns [Hz]."""
        dr, types = drjit_types()
        corners = np.ascontiguousarray(vertices[faces], dtype=np.float64)
        self.corners = types.Float64(corners.reshape(-1))
        self.starts = np.searchsorted(piece, np.arange(int(piece.max()) + 2))
        self.material = material
        self.frequency = frequency
        self.layer = MeshLayer([(vertices, faces)], np.zeros(3), moving=False)
        self.clearance = _CLEARANCE * float(np.abs(vertices).max())
        dr.eval(self.corners)


def exact_basis(vector: Any) -> tuple[Any, Any, Any]:
    """Unit vector along a direction of propagation `mi.Vector3f`, and Sionna's implicit basis across it, in float64."""
    import mitsuba as mi
    from sionna.rt.utils import implicit_basis_vector

    dr, types = drjit_types()

    def exact(vector: Any) -> Any:
        detached = dr.detach(vector, preserve_type=False)
        return dr.normalize(types.Array3f64(*(types.Float64(detached[axis]) for axis in range(3))))

    k = exact(vector)
    first = exact(implicit_basis_vector(mi.Vector3f(vector)))
    first = dr.normalize(first - dr.dot(first, k) * k)
    return k, first, dr.cross(k, first)


class ScatteringPoint:
    """One piece of a body as a scattering point: callables for Sionna's `register_rcs`, `register_cpm` and
    `ScatteringModel`.

    A facet counts where both ends see it past the body's other facets; Sionna's scene casts the body's forward shadow.
    """

    def __init__(self, body: ScatteringMesh, piece: int, place: FloatArray) -> None:
        dr, types = drjit_types()
        self._body = body
        # Opaque values, so that all points of a body share one kernel.
        self._first = dr.opaque(types.UInt32, int(body.starts[piece]))
        self._last = dr.opaque(types.UInt32, int(body.starts[piece + 1]))
        self._place = types.Array3f64(*(dr.opaque(types.Float64, float(x)) for x in place))

    def rcs(self, k_i: Any, k_s: Any, seed: int = 0) -> Any:
        """Radar cross-section [m^2], mean over two orthogonal polarisations; `seed` is ignored."""
        import mitsuba as mi

        return mi.Float(self._power(self.jones(k_i, k_s)))

    def cpm(self, k_i: Any, k_s: Any, seed: int = 0) -> tuple[Any, Any]:
        """Real and imaginary part of the scattering matrix over the root of :meth:`rcs`, in Sionna's implicit basis."""
        import drjit as dr
        import mitsuba

        mi: Any = mitsuba
        jones = self.jones(k_i, k_s)
        power = self._power(jones)
        scale = dr.select(power > 0, dr.rsqrt(dr.maximum(power, 1e-300)), 0.0)
        return (
            mi.Matrix2f(*(mi.Float(each.re * scale) for each in jones)),
            mi.Matrix2f(*(mi.Float(each.im * scale) for each in jones)),
        )

    @staticmethod
    def _power(jones: tuple[ComplexPair, ...]) -> Any:
        return 0.5 * sum(each.re * each.re + each.im * each.im for each in jones)

    def jones(self, k_i: Any, k_s: Any) -> tuple[ComplexPair, ComplexPair, ComplexPair, ComplexPair]:
        """Scattering matrix [m] row by row (out, in), in float64, for directions of propagation `mi.Vector3f`."""
        dr, types = drjit_types()
        Float, UInt32, Array3 = types.Float64, types.UInt32, types.Array3f64
        body = self._body

        (k_in, *incoming), (k_out, *outgoing) = exact_basis(k_i), exact_basis(k_s)
        frequency = body.frequency()
        wavenumber = dr.opaque(Float, 2 * np.pi * frequency / SPEED_OF_LIGHT)
        zero = dr.zeros(UInt32, 1)
        media = media_tables(dr, types, Media.at((body.material,), np.array([frequency])))
        medium = media_of_lanes(dr, types, media, zero, zero, wavenumber)
        change = wavenumber * (k_in - k_out)

        def one_facet(index: Any, *sums: Any) -> tuple[Any, ...]:
            corners = [
                Array3(*(dr.gather(Float, body.corners, index * 9 + corner * 3 + axis) for axis in range(3)))
                for corner in range(3)
            ]
            cross = dr.cross(corners[1] - corners[0], corners[2] - corners[0])
            twice_area = dr.norm(cross)
            normal = cross / dr.maximum(twice_area, 1e-30)
            normal = dr.select(dr.dot(normal, k_in) > 0, -normal, normal)
            facing = (twice_area > 0) & (dr.dot(normal, k_in) < 0) & (dr.dot(normal, k_out) > 0)
            visible = self._visible_share(corners, normal, k_in, k_out, facing)
            phases = tuple(dr.dot(change, corner - self._place) for corner in corners)
            mean = moments(dr, phases).mean.scaled(0.5 * twice_area * visible)
            out = []
            for number, (e_out, e_in) in enumerate((o, i) for o in outgoing for i in incoming):
                both = (k_in, e_in, k_out, e_out), (-k_out, e_out, -k_in, e_in)
                waves = (ScatteredWave(dr, Array3, normal, *ends) for ends in both)
                there, back = (wave.obliquity(dr, types.Complex2f64, medium) for wave in waves)
                term = (there + back).scaled(0.5).times(mean)
                out += [sums[2 * number] + term.re, sums[2 * number + 1] + term.im]
            return (index + 1, *out)

        lanes = max(dr.width(k_in), dr.width(k_out))
        start = self._first + dr.zeros(UInt32, lanes)
        state = (start, *(dr.zeros(Float, lanes) for _ in range(8)))
        _, *sums = dr.while_loop(state, lambda index, *_: index < self._last, one_facet)
        scale = float(np.sqrt(4 * np.pi)) / (2 * np.pi) * wavenumber
        pairs = [ComplexPair(sums[2 * n], sums[2 * n + 1]).turned().scaled(scale) for n in range(4)]
        return pairs[0], pairs[1], pairs[2], pairs[3]

    def _visible_share(self, corners: list[Any], normal: Any, k_in: Any, k_out: Any, active: Any) -> Any:
        """Share of a facet that both ends see, of three points."""
        import drjit as dr
        import mitsuba

        mi: Any = mitsuba
        total = 0.0
        for weights in _GUIDE_POINTS:
            point = sum(weight * corner for weight, corner in zip(weights, corners, strict=True))
            point = mi.Point3f(point + self._body.clearance * normal)
            free = mi.Bool(active)
            for towards in (-k_in, k_out):
                free &= ~self._body.layer.scene.ray_test(mi.Ray3f(point, mi.Vector3f(towards)), active=free)
            total = total + dr.select(dr.detach(free, preserve_type=False), 1 / 3, 0.0)
        return total
