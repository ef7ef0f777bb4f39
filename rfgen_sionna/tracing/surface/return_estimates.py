"""Estimates of the return of flat facets from their corners, in NumPy and on the device.

`corners` are relative to the radar, axis by axis and corner by corner: an array (axis, corner, facet) [m], or nine
arrays of Dr.Jit.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray


def estimate_returns(corners: Any, wavenumber: Any) -> Any:
    """(facet,) estimated returns up to a common factor: solid angle times :func:`mean_phasor`."""
    return abs(solid_angles(corners)) * mean_phasor(corners, wavenumber)


def solid_angles(corners: Any) -> Any:
    """(facet,) solid angles [sr] in the far field, negative for facets that face away."""
    m = _array_module(corners[0][0])
    a, one, other = ([axis[k] - (axis[0] if k else 0.0) for axis in corners] for k in range(3))
    volume = sum(a[i] * (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2]) for i in range(3))
    x, y, z = (axis[0] + axis[1] + axis[2] for axis in corners)
    square = m.maximum(x * x + y * y + z * z, 1e-18)  # of three times the distance of the middle
    return -13.5 * volume / (square * m.sqrt(square))


def mean_phasor(corners: Any, wavenumber: Any) -> Any:
    """(facet,) estimated two-way mean phasor's magnitude. With phases a < b < c [rad] at the corners it is 2 / (c - a)
    times the difference of two phasors of lengths sinc((b - a) / 2) and sinc((c - b) / 2)
    (:mod:`rfgen_sionna.tracing.integral.simplex`): an edge across the wave returns more than a corner."""
    m = _array_module(corners[0][0])
    x, y, z = (m.sqrt(each) for each in _squares(corners))
    near, far = m.minimum(m.minimum(x, y), z), m.maximum(m.maximum(x, y), z)
    # Half the phases of the two-way path.
    total, first = wavenumber * (far - near), wavenumber * (x + y + z - 2.0 * near - far)
    second = total - first
    edges = m.sqrt(1.0 / (1.0 + first * first) + 1.0 / (1.0 + second * second))
    return m.minimum(1.0, edges / m.maximum(total, 1e-9))


def _squares(corners: Any) -> list[Any]:
    """Squared distances of the three corners."""
    x, y, z = corners
    return [x[k] * x[k] + y[k] * y[k] + z[k] * z[k] for k in range(3)]


def _array_module(values: FloatArray | Any) -> ModuleType:
    """Module with `sqrt`, `minimum` and `maximum` for the array type."""
    if isinstance(values, np.ndarray):
        return np
    import drjit

    return drjit
