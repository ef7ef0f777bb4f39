"""Propagation between elements via points: delays, delay rates, phasors."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload


def propagation_delays(places: FloatArray, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """(tx, rx, point) delays [s] from elements `tx` (tx, 3) to elements `rx` (rx, 3) via `places` (point, 3) [m]."""
    count, shape = len(places), (len(tx), len(rx), len(places))
    if not count:
        return np.zeros(shape)
    dr, types = drjit_types()
    found = dr.empty(types.Float64, int(np.prod(shape)))
    given = {
        "lanes": dr.arange(types.UInt32, count),
        "places": upload(types.Float64, places),
        "elements": upload(types.Float64, np.concatenate([tx, rx])),
        "count": dr.opaque(types.UInt32, count),
        "found": found,
    }
    _DELAYS(given, len(tx), len(rx))
    return np.asarray(found.numpy()).reshape(shape)


def _delay(given: dict[str, Any], senders: int, receivers: int) -> None:
    """Kernel of :func:`propagation_delays`."""
    dr, types = drjit_types()
    Float, UInt32, Array3, lane = types.Float64, types.UInt32, types.Array3f64, given["lanes"]
    place = Array3(*(dr.gather(Float, given["places"], 3 * lane + axis) for axis in range(3)))
    ways = [
        dr.norm(place - Array3(*(dr.gather(Float, given["elements"], UInt32(3 * each + axis)) for axis in range(3))))
        for each in range(senders + receivers)
    ]
    for sender in range(senders):
        for receiver in range(receivers):
            delay = (ways[sender] + ways[senders + receiver]) / SPEED_OF_LIGHT
            row = lane + given["count"] * (sender * receivers + receiver)
            dr.scatter(given["found"], delay, row, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_DELAYS = FrozenKernel(_delay)


def delay_rates(places: FloatArray, velocities: FloatArray, tx: FloatArray, rx: FloatArray) -> FloatArray:
    """(tx, rx, point) rates [s/s] of :func:`propagation_delays`, for points of `velocities` (point, 3) [m/s]."""
    place, speed = (np.ascontiguousarray(each.T) for each in (places, velocities))
    to_tx, to_rx = (np.stack([_range_rates(one, place, speed) for one in each]) for each in (tx, rx))
    return np.asarray((to_tx[:, None] + to_rx) / SPEED_OF_LIGHT)


def _range_rates(element: FloatArray, place: FloatArray, speed: FloatArray) -> FloatArray:
    """(point,) rates [m/s] of the distances of an `element` (3,) from points (axis, point) [m] of `speed` [m/s]."""
    x, y, z = place - element[:, None]
    along = x * speed[0] + y * speed[1] + z * speed[2]
    return np.asarray(along / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-12))


def phasors(cycles: FloatArray) -> ComplexArray:
    """exp(-2j pi c) of the `cycles` c, of any shape; error 1e-15 beyond the rounding of `cycles`."""
    if not cycles.size:
        return np.zeros(cycles.shape, np.complex128)
    dr, types = drjit_types()
    found = dr.empty(types.Float64, 2 * cycles.size)
    _TURN({"lanes": dr.arange(types.UInt32, cycles.size), "cycles": upload(types.Float64, cycles), "found": found})
    return np.asarray(found.numpy()).view(np.complex128).reshape(cycles.shape)


def _turn(given: dict[str, Any]) -> None:
    """Kernel of :func:`phasors`."""
    dr, _ = drjit_types()
    cycles, lane = given["cycles"], given["lanes"]
    sin, cos = dr.sincos((-2.0 * float(np.pi)) * (cycles - dr.round(cycles)))
    for k, each in enumerate((cos, sin)):
        dr.scatter(given["found"], each, 2 * lane + k, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_TURN = FrozenKernel(_turn)
