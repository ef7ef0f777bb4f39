"""Estimated returns of a few representative faces, from which sample times are chosen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import lengths, max_component, triangle_centroids
from rfgen_sionna.tracing.surface.resolution import FACET_BULGE, phase_bulge
from rfgen_sionna.tracing.surface.return_estimates import mean_phasor, solid_angles, width_and_distance

STRONGEST, OTHERS = 500, 250
"""Faces of a mesh whose gains are compared: the strongest ones, and representatives of all others."""
MANY_FACES = 10_000
"""Faces of a mesh above which a single pose decides which faces are strong, to save time."""
_TURNED_POSES = 24
"""Poses of a fast turning mesh that decide which faces are strong."""
_TRIED, _MOST_TRIED = 4, 400
"""Test times per gap and largest number of them, more with more gaps and knots."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class RepresentativeFaces:
    """Representative faces of a mesh with `vertices` (vertex, 3) [m] at evenly spaced times; `longest_edges` (face,)
    [m] limit the facets of each face, None does not."""

    def __init__(
        self,
        vertices: Sequence[FloatArray],
        faces: IntArray,
        closed: bool,
        viewpoint: FloatArray,
        frequency: float,
        longest_edges: FloatArray | None = None,
    ) -> None:
        wavenumber, size, strength = 4 * np.pi * frequency / SPEED_OF_LIGHT, np.zeros(len(faces)), np.zeros(len(faces))
        # Faces that are strong at one end only count as well.
        poses = [vertices[0], vertices[-1]] if len(faces) < MANY_FACES else [vertices[len(vertices) // 2]]
        if longest_edges is not None:  # what turns fast shows other faces in between
            poses = list(vertices[:: max(1, len(vertices) // _TURNED_POSES)])
        for points in poses:
            found, angle = _estimated_returns(points, faces, viewpoint, wavenumber)
            if closed:
                found, angle = np.where(angle > 0, found, 0.0), np.maximum(angle, 0.0)
            strength, size = np.maximum(strength, found), np.maximum(size, np.abs(angle))
        some = np.flatnonzero(strength)
        order = some[np.argsort(-strength[some])]
        rest = order[STRONGEST:]
        step = max(1, -(-len(rest) // OTHERS))
        chosen = np.concatenate([order[:STRONGEST], rest[::step]])
        ends, counted = faces[chosen], np.where(np.arange(len(chosen)) < STRONGEST, 1.0, step)
        # The middle piece represents a large face, and one weak face several others.
        middle = vertices[len(vertices) // 2][ends]
        bulge = phase_bulge(middle, viewpoint, frequency)
        self._share = np.sqrt(FACET_BULGE / np.maximum(bulge, FACET_BULGE))
        if longest_edges is not None:
            edges = max_component(lengths(middle - middle[:, [1, 2, 0]]))
            self._share = np.minimum(self._share, longest_edges[chosen] / np.maximum(edges, 1e-12))
        self._size = size[chosen] * self._share * np.sqrt(counted)
        self._phases = wavenumber * np.stack([self._away(each[ends] - viewpoint) for each in vertices])

    def _away(self, corners: FloatArray) -> FloatArray:
        """(corner, face) distances [m] of the corners of the faces' middle pieces, of faces with `corners` (face, 3, 3)
        [m]."""
        inner = triangle_centroids(corners)[:, None]
        return lengths(inner + self._share[:, None, None] * (corners - inner)).T

    def missed(self, gaps: int) -> float:
        """Error of a spline with `gaps` gaps, of the incoherent sum of the faces."""
        if not len(self._size):
            return 0.0
        # At more times than knots and gaps, aperiodic as vibrations may be in step.
        finest = max(gaps, len(self._phases) - 1)
        tried = max(min(max(_TRIED * gaps, 2 * finest), _MOST_TRIED), finest + 1)
        sample_times = np.linspace(0.0, 1.0, gaps + 1)
        times = (np.arange(tried) + np.mod(_GOLDEN * np.arange(1, tried + 1), 1.0)) / tried
        truth = self._gains(times)
        missed = knot_weights(sample_times, times) @ self._gains(sample_times) - truth
        energy, error = (float((each.real**2 + each.imag**2).sum()) for each in (truth, missed))
        return float(np.sqrt(error / energy)) if energy > 0 else 0.0

    def _gains(self, times: FloatArray) -> ComplexArray:
        """(time, face) gains at `times`, 0 … 1 over the interval."""
        weights = knot_weights(np.linspace(0.0, 1.0, len(self._phases)), times)
        phases = np.moveaxis(np.tensordot(weights, self._phases, 1), 1, 0)
        return np.asarray(self._size * _mean_phasor(_turned(phases)))


def _estimated_returns(
    vertices: FloatArray, faces: IntArray, viewpoint: FloatArray, wavenumber: float
) -> tuple[FloatArray, FloatArray]:
    """(face,) estimated return of each face, up to a common factor, and its solid angle [sr], negative where it faces
    away."""
    if not len(faces):
        return np.zeros(0), np.zeros(0)
    dr, types = drjit_types()
    found = [dr.empty(types.Float64, len(faces)) for _ in range(2)]
    given = {
        "lanes": dr.arange(types.UInt32, len(faces)),
        "vertices": upload(types.Float64, vertices),
        "faces": upload(types.UInt32, faces),
        "radar": upload(types.Float64, [*viewpoint, wavenumber]),
        "found": found,
    }
    _ESTIMATED_RETURNS(given)
    strength, angle = (each.numpy() for each in found)
    return strength, angle


def _estimate_returns(given: dict[str, Any]) -> None:
    """Kernel of :func:`_estimated_returns`."""
    dr, types = drjit_types()
    Float, UInt32, lane = types.Float64, types.UInt32, given["lanes"]
    radar = [dr.gather(Float, given["radar"], UInt32(k)) for k in range(4)]
    ends = [dr.gather(UInt32, given["faces"], 3 * lane + k) for k in range(3)]
    corners = [
        [dr.gather(Float, given["vertices"], 3 * each + axis) - radar[axis] for each in ends] for axis in range(3)
    ]
    angle, wavenumber = solid_angles(corners), radar[3]
    # Large faces are traced in pieces; the bulge of the phase is about k width^2 / (4 distance).
    width, near = width_and_distance(corners)
    share = dr.sqrt(dr.minimum(8.0 * FACET_BULGE * near / dr.maximum(wavenumber * width * width, 1e-300), 1.0))
    strength = abs(angle) * share * mean_phasor(corners, 0.5 * wavenumber * share)
    for values, where in zip((strength, angle), given["found"], strict=True):
        dr.scatter(where, values, lane, mode=dr.ReduceMode.Permute)
    dr.eval(*given["found"])


_ESTIMATED_RETURNS = FrozenKernel(_estimate_returns)


def _turned(phases: FloatArray) -> FloatArray:
    """(corner, ..., face) `phases` [rad] relative to those of the centre."""
    return np.asarray(phases - (phases[0] + phases[1] + phases[2]) / 3.0)


def _mean_phasor(phases: FloatArray) -> ComplexArray:
    """(..., face) mean of exp(-jφ) over faces with a linear phase φ and corner `phases` (corner, ..., face) [rad]:
    twice a divided difference (:mod:`rfgen_sionna.tracing.integral.simplex`)."""
    a, b, c = np.sort(phases, axis=0)
    first, last = (np.exp(-0.5j * (x + y)) * np.sinc((y - x) / (2 * np.pi)) for x, y in ((a, b), (b, c)))
    spread = c - a
    # Below, cancellation exceeds the error of the mean phase, the square over 36.
    narrow = spread < 1e-5
    return np.asarray(np.where(narrow, np.exp(-1j * b), 2j * (last - first) / np.where(narrow, 1.0, spread)))
