"""Elements of a radar as antenna arrays and radio devices of Sionna.

:func:`~rfgen_sionna.scene.mitsuba_backend.ensure_backend` must have run.
"""

from __future__ import annotations

from typing import Any, Literal

import drjit as dr
import mitsuba
import numpy as np
import sionna.rt

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.pose import POLARIZATIONS

mi: Any = mitsuba  # its type stubs lack the variants
ArrayEnd = Literal["tx", "rx"]
_PATTERN_STEP = 0.5
"""Grid step of element patterns on the device [degrees]; a step of 2 errs by 0.003 dB."""


def grid_directions(step: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Azimuths and elevations [degrees] around the sphere, and (azimuth, elevation, 3) unit vectors, device frame."""
    azimuth = np.linspace(-180.0, 180.0, round(360 / step) + 1)
    elevation = np.linspace(-90.0, 90.0, round(180 / step) + 1)
    a, e = np.meshgrid(np.radians(azimuth), np.radians(elevation), indexing="ij")
    return azimuth, elevation, np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)


class ElementAntenna(sionna.rt.AntennaPattern):
    """Element pattern and polarisation of one end of a radar.

    The field towards k is the element's field direction, projected transverse to k and normalised, times the square
    root of the gain, as in this package's tracer.
    """

    def __init__(self, radar: Radar, end: ArrayEnd) -> None:
        _, _, directions = grid_directions(_PATTERN_STEP)
        table = radar.pattern.amplitude(directions)
        rows, columns = table.shape
        values = mi.Float(np.ascontiguousarray(table, dtype=np.float32).ravel())
        field = POLARIZATIONS[radar.tx_polarization if end == "tx" else radar.rx_polarization]

        def amplitude(theta: Any, phi: Any) -> Any:
            turn = phi + dr.pi
            turn = turn - dr.floor(turn / dr.two_pi) * dr.two_pi
            x = dr.clip(turn * (180.0 / dr.pi / _PATTERN_STEP), 0.0, rows - 1.0)
            y = dr.clip((dr.pi - theta) * (180.0 / dr.pi / _PATTERN_STEP), 0.0, columns - 1.0)
            i, j = dr.minimum(mi.UInt32(x), rows - 2), dr.minimum(mi.UInt32(y), columns - 2)
            u, v = x - mi.Float(i), y - mi.Float(j)

            def at(di: int, dj: int) -> Any:
                return dr.gather(mi.Float, values, (i + di) * columns + j + dj)

            low, high = ((1 - v) * at(di, 0) + v * at(di, 1) for di in (0, 1))
            return (1 - u) * low + u * high

        def pattern(theta: Any, phi: Any) -> tuple[Any, Any]:
            (sin_theta, cos_theta), (sin_phi, cos_phi) = dr.sincos(theta), dr.sincos(phi)
            x, y, z = (mi.Float(component) for component in field)
            along_theta = cos_theta * (cos_phi * x + sin_phi * y) - sin_theta * z
            along_phi = cos_phi * y - sin_phi * x
            size = dr.sqrt(along_theta * along_theta + along_phi * along_phi)
            scale = dr.select(size > 1e-6, amplitude(theta, phi) / dr.maximum(size, 1e-6), 0.0)
            return mi.Complex2f(along_theta * scale, 0.0), mi.Complex2f(along_phi * scale, 0.0)

        self.patterns = [pattern]


class RadarArray(sionna.rt.AntennaArray):
    """Elements of one end of a radar, at fixed positions in metres at any frequency of the scene."""

    def __init__(self, radar: Radar, end: ArrayEnd) -> None:
        self.element_positions: FloatArray = radar.tx_positions if end == "tx" else radar.rx_positions
        """(element, 3) [m], device frame."""
        self.polarization: str = radar.tx_polarization if end == "tx" else radar.rx_polarization
        self.pattern = radar.pattern
        # `normalized_positions` counts in wavelengths of the radar's centre frequency.
        super().__init__(ElementAntenna(radar, end), mi.Point3f(self.element_positions.T / radar.wavelength))

    def positions(self, wavelength: Any, expand_patterns: bool = False) -> Any:
        """Element positions [m], device frame, at any wavelength; one pattern each."""
        return mi.Point3f(self.element_positions.T)

    def matches_end(self, radar: Radar, end: ArrayEnd) -> bool:
        """Whether `radar` has the same elements at this end."""
        other = radar.tx_positions if end == "tx" else radar.rx_positions
        field = radar.tx_polarization if end == "tx" else radar.rx_polarization
        return (
            np.array_equal(self.element_positions, other)
            and self.polarization == field
            and self.pattern == radar.pattern
        )


class RadarTransmitter(sionna.rt.Transmitter):
    """Transmitting end of a radar in a Sionna scene."""

    def __init__(self, radar: Radar, name: str) -> None:
        super().__init__(name=name, power_dbm=radar.tx_power_dbm, **_motion(radar))
        self.radar = radar


class RadarReceiver(sionna.rt.Receiver):
    """Receiving end of a radar in a Sionna scene."""

    def __init__(self, radar: Radar, name: str) -> None:
        super().__init__(name=name, **_motion(radar))
        self.radar = radar


def _motion(radar: Radar) -> dict[str, Any]:
    """Position [m], orientation [rad] and velocity [m/s] at t = 0."""
    step = 1e-4
    velocity = np.subtract(radar.pose(step)[0], radar.pose(-step)[0]) / (2 * step)
    place, turn = mi.Point3f(*radar.position), mi.Point3f(*radar.orientation)
    return {"position": place, "orientation": turn, "velocity": mi.Vector3f(*velocity.tolist())}
