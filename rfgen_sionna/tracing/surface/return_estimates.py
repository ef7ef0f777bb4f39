"""About what flat facets return, by their corners: of NumPy's numbers and of those on the device.

`corners` are three axes of three corners each, seen from the radar: an array (axis, corner, facet) [m], or nine Dr.Jit
arrays.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray


def estimate_returns(corners: Any, wavenumber: Any, aside: Any = 0.0, turn: Any = None) -> Any:
    """(facet,) about what facets return, up to a factor that all share: their solid angle times the mean phasor over
    each, by the `wavenumber` [rad/m] of all or of each and what the phase turns less `aside` of the radar.

    With a `turn` (facet,) it is what they may return whose normals lean from the flat facets' by so much at some
    corner, as a chord: aslant most comes from corners and edges, with the cosines there, which exceed that of the flat
    facet by as much at most."""
    angles = abs(solid_angles(corners))
    if turn is not None:
        angles = angles + turn * facing_solid_angles(corners)
    return angles * mean_phasor(corners, wavenumber, aside)


def off_axis_phase(corners: Any, wavenumber: float, aperture: float) -> Any:
    """(facet,) by how much less the phase [rad], there and back, may turn over facets for elements whose displacements
    from the middle add up to `aperture` [m]."""
    width, distance = width_and_distance(corners)
    return wavenumber * aperture * width / _array_module(width).maximum(distance, 1e-9)


def width_and_distance(corners: Any) -> tuple[Any, Any]:
    """(facet,) longest edge, and how far the nearest corner is [m]."""
    m = _array_module(corners[0][0])
    square = 0.0
    for k in range(3):
        x, y, z = (axis[k] - axis[k - 1] for axis in corners)
        square = m.maximum(square, x * x + y * y + z * z)
    near = _squares(corners)
    return m.sqrt(square), m.sqrt(m.minimum(m.minimum(near[0], near[1]), near[2]))


def solid_angles(corners: Any) -> Any:
    """(facet,) [sr] that they take far off, below zero where they look away."""
    m = _array_module(corners[0][0])
    a, one, other = ([axis[k] - (axis[0] if k else 0.0) for axis in corners] for k in range(3))
    volume = sum(a[i] * (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2]) for i in range(3))
    x, y, z = (axis[0] + axis[1] + axis[2] for axis in corners)
    square = m.maximum(x * x + y * y + z * z, 1e-18)  # of three times the distance of the middle
    return -13.5 * volume / (square * m.sqrt(square))


def facing_solid_angles(corners: Any) -> Any:
    """(facet,) [sr] that they would take, turned to where they face the radar."""
    m = _array_module(corners[0][0])
    one, other = ([axis[k] - axis[0] for axis in corners] for k in (1, 2))
    x, y, z = (one[i - 2] * other[i - 1] - one[i - 1] * other[i - 2] for i in range(3))
    a, b, c = (axis[0] + axis[1] + axis[2] for axis in corners)
    return 4.5 * m.sqrt(x * x + y * y + z * z) / m.maximum(a * a + b * b + c * c, 1e-18)


def mean_phasor(corners: Any, wavenumber: Any, aside: Any = 0.0) -> Any:
    """(facet,) about how long the mean phasor over each is, there and back, by the `wavenumber` [rad/m] of all or of
    each (facet,), where the phase turns by so much [rad] less, `aside` (facet,).

    With phases a < b < c at the corners that is 2 / (c - a) times the difference of two phasors, of the lengths
    sinc((b - a) / 2) and sinc((c - b) / 2) (:mod:`rfgen_sionna.tracing.integral.simplex`): an edge that lies across the
    wave's way returns more than a corner does.
    """
    m = _array_module(corners[0][0])
    x, y, z = (m.sqrt(each) for each in _squares(corners))
    near, far = m.minimum(m.minimum(x, y), z), m.maximum(m.maximum(x, y), z)
    # Half the phases, as the way is there and back.
    total, first = wavenumber * (far - near), wavenumber * (x + y + z - 2.0 * near - far)
    second = total - first
    if not isinstance(aside, float) or aside:
        total, first, second = (m.maximum(each - 0.5 * aside, 0.0) for each in (total, first, second))
    edges = m.sqrt(1.0 / (1.0 + first * first) + 1.0 / (1.0 + second * second))
    return m.minimum(1.0, edges / m.maximum(total, 1e-9))


def _squares(corners: Any) -> list[Any]:
    """Squares of the distances of the three corners."""
    x, y, z = corners
    return [x[k] * x[k] + y[k] * y[k] + z[k] * z[k] for k in range(3)]


def _array_module(values: FloatArray | Any) -> ModuleType:
    """What has `sqrt`, `minimum` and `maximum` of such numbers."""
    if isinstance(values, np.ndarray):
        return np
    import drjit

    return drjit
