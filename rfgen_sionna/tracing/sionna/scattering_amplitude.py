"""Scattering amplitudes of meshes in the far field, for given polarisations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.tracing.relative_scene import RelativeObject

MAX_LANES = 4096
"""Directions per kernel launch."""
_FIELDS = {"V": 2, "H": 1}
"""Row of the field's direction in :func:`scattering_amplitudes`."""


def scattering_amplitudes(
    parts: Sequence[RelativeObject],
    size: float,
    start: FloatArray,
    towards: FloatArray,
    frequency: float,
    polarization: str,
    steps: int,
) -> ComplexArray:
    """(direction,) amplitudes [m] from the direction `start` (1, 3, 3) to each of `towards` (direction, 3, 3); rows are
    the unit vectors to the end, to its left, and of vertical fields.

    `parts` are about the middle of a mesh of `size` [m]; facets are at most `size` / `steps` wide. `polarization` is
    that of the transmitter and of the receiver, "V" or "H" each.
    """
    ensure_backend()
    import mitsuba

    from rfgen_sionna.scene.ray_layer import MeshLayer
    from rfgen_sionna.tracing.sionna.far_field import ScatteringMesh, ScatteringPoint, exact_basis
    from rfgen_sionna.tracing.sionna.sensing_target import subdivide

    mi: Any = mitsuba
    whole = MeshLayer([(part.vertices(0.0), part.faces) for part in parts], np.zeros(3), moving=False)
    total: ComplexArray = np.zeros(len(towards), np.complex128)
    sent, received = start[0, _FIELDS[polarization[0]]], towards[:, _FIELDS[polarization[1]]]
    for part in parts:
        corners, faces = subdivide(part.vertices(0.0), part.rest_vertices, part.faces, size / steps, frequency)
        one = np.zeros(len(faces), np.int32)
        body = ScatteringMesh(corners, faces, one, part.properties, lambda: frequency)
        body.layer = whole
        point = ScatteringPoint(body, 0, np.zeros(3))
        for first in range(0, len(towards), MAX_LANES):
            some = towards[first : first + MAX_LANES, 0]
            k_in = mi.Vector3f(*(mi.Float(np.full(len(some), each, np.float32)) for each in -start[0, 0]))
            k_out = mi.Vector3f(*(mi.Float(np.ascontiguousarray(each, np.float32)) for each in some.T))
            entries = [np.asarray(each.re.numpy() + 1j * each.im.numpy()) for each in point.jones(k_in, k_out)]
            rows, columns = (
                np.stack([(np.stack([axis.numpy() for axis in each], axis=-1) * field).sum(axis=-1) for each in basis])
                for basis, field in (
                    (exact_basis(k_in)[1:], sent),
                    (exact_basis(k_out)[1:], received[first : first + len(some)]),
                )
            )
            total[first : first + len(some)] += sum(
                columns[o] * entries[2 * o + i] * rows[i] for o in range(2) for i in range(2)
            )
    return total
