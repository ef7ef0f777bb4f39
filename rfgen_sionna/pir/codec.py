"""Physical units to image channels in −1 … 1 and back.

:class:`PirCodec` is the convention of this package's image models, :class:`AuthorsCodec` that of the RF LoRA that was
published with the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar.pose import rotation_matrix
from rfgen_sionna.records import Pir

Image = NDArray[np.float32]

_TOLERANCE = 1e-3
"""Upper bound of rounding beyond −1 … 1: half precision at 1."""
_PRESENT = -2.0 / 3.0
"""Lower bound of the third channel of a pixel with a return: midway between an empty one and the fastest approach."""
_STATIC_SPEED = 1e-3
"""Root of the share of `max_speed` below which a velocity is 0: above the rounding of 1/3 in half precision."""


class ImageRangeError(ValueError):
    """Image values outside of their convention."""


@dataclass(frozen=True)
class PirCodec:
    """Three channels in −1 … 1.

    ========  =====================================  ===========================================================
    channel   quantity                               value
    ========  =====================================  ===========================================================
    0         energy, logarithmic                    −1 at `energy_db[0]`, 1 at `energy_db[1]`; −1 in empty pixels
    1         range, logarithmic beyond `knee`       −1 at 0 m, 1 at `max_range`; 1 in empty pixels
    2         validity and radial velocity           −1 in empty pixels, else 1/3 + 2/3 sign(v) √(|v|/`max_speed`)
    ========  =====================================  ===========================================================

    Decoding inverts encoding to 1e-4 dB, 1e-5 of range plus `knee`, and 1e-4 of `max_speed` (single precision).
    Energies below the floor become the floor; speeds below 1e-6 of `max_speed` become 0.
    """

    energy_db: tuple[float, float] = (-180.0, -50.0)
    """Weakest and strongest energy of a pixel [dB]."""
    max_range: float = 120.0
    """[m]"""
    knee: float = 3.0
    """Range [m] up to which the channel is about linear, and beyond which about logarithmic."""
    max_speed: float = 20.0
    """[m/s]"""

    def encode(self, pir: Pir, *, clip: bool = False) -> Image:
        """(3, row, column) channels of `pir`; energies under the floor are raised to it.

        Parameters
        ----------
        pir
            The PIR.
        clip
            Clip values to the convention's range; False refuses values above it.

        Raises
        ------
        ImageRangeError
            If energies, ranges or velocities are out of the convention's range, without `clip`.
        """
        return self.encode_arrays(pir.energy, pir.time_of_arrival, pir.velocity, clip=clip)

    def encode_arrays(
        self, energy: ArrayLike, time_of_arrival: ArrayLike, velocity: ArrayLike, *, clip: bool = False
    ) -> Image:
        """(…, 3, row, column) channels of images (…, row, column); see :meth:`encode`."""
        power, distance, speed = (np.asarray(x, dtype=np.float64) for x in (energy, time_of_arrival, velocity))
        there = (power > 0) & np.isfinite(distance)
        distance = np.where(there, 0.5 * SPEED_OF_LIGHT * distance, 0.0)
        if not clip:
            strongest = 10 ** (self.energy_db[1] / 10)
            _refuse("energy", np.where(there, power, 0.0), 0.0, strongest, "")
            _refuse("range", distance, 0.0, self.max_range, " m")
            _refuse("velocity", np.where(there, speed, 0.0), -self.max_speed, self.max_speed, " m/s")
        low, high = self.energy_db
        energy_db = 10 * np.log10(np.where(there, power, 1.0))
        first = np.where(there, 2 * (energy_db - low) / (high - low) - 1, -1.0)
        second = np.where(there, 2 * np.log1p(distance / self.knee) / self._log_range - 1, 1.0)
        third = np.where(there, 1 / 3 + 2 / 3 * np.sign(speed) * np.sqrt(np.abs(speed) / self.max_speed), -1.0)
        return np.clip(np.stack([first, second, third], axis=-3), -1.0, 1.0).astype(np.float32)

    def decode(self, image: ArrayLike, like: Pir, *, clip: bool = False) -> Pir:
        """PIR of the channels `image` (3, row, column), with the viewpoint, field of view and time of `like`.

        Parameters
        ----------
        image
            (3, row, column) channels.
        like
            PIR of the same view.
        clip
            Clip values to −1 … 1, as generated images need; False refuses values beyond.

        Raises
        ------
        ImageRangeError
            If the image has other channels, or values out of range without `clip`.
        """
        energy, arrival, velocity = self.decode_arrays(image, clip=clip)
        if energy.ndim != 2:
            raise ImageRangeError(f"image has shape {np.shape(image)}: (3, row, column) is needed")
        return replace(like, energy=energy, time_of_arrival=arrival, velocity=velocity)

    def decode_arrays(self, image: ArrayLike, *, clip: bool = False) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Energy, time of arrival [s] and velocity [m/s], each (…, row, column), of images (…, 3, row, column)."""
        x = check_image(image, clip=clip)
        there = x[..., 2, :, :] > _PRESENT
        low, high = self.energy_db
        energy = np.where(there, 10 ** ((low + 0.5 * (x[..., 0, :, :] + 1) * (high - low)) / 10), 0.0)
        distance = self.distance(x[..., 1, :, :])
        arrival = np.where(there, 2 * distance / SPEED_OF_LIGHT, np.nan)
        fraction = np.clip((x[..., 2, :, :] - 1 / 3) * 1.5, -1.0, 1.0)
        moves = there & (np.abs(fraction) > _STATIC_SPEED)
        velocity = np.where(moves, np.sign(fraction) * fraction**2 * self.max_speed, 0.0)
        return energy, arrival, velocity

    def distance(self, channel: FloatArray) -> FloatArray:
        """Range [m] of values of the second channel."""
        return np.asarray(self.knee * np.expm1(0.5 * (channel + 1) * self._log_range))

    @property
    def _log_range(self) -> float:
        return float(np.log1p(self.max_range / self.knee))


@dataclass(frozen=True)
class AuthorsCodec:
    """Images of the published RF LoRA: red is depth, green is amplitude, each 0 … 1 in the file; blue is unused.

    Depth along the boresight is `nearest` + `span` × red; energy is `full_scale` × green², since the paper's amplitudes
    have no unit. Velocities are 0. The files have no field of view; the paper's is 60 degrees, square.
    """

    nearest: float = 5.0
    """Least depth [m]."""
    span: float = 5.0
    """Range of depths [m]."""
    full_scale: float = 1e-8
    """Energy of a pixel at full amplitude: a mirror at 1.6 m at 77 GHz."""

    def encode(self, pir: Pir, *, clip: bool = False) -> Image:
        """(3, row, column) channels in −1 … 1 of `pir`, as :meth:`PirCodec.encode`; ValueError if not perspective."""
        there = (pir.energy > 0) & np.isfinite(pir.time_of_arrival)
        depth = np.where(there, 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival, self.nearest) / _ray_over_depth(pir)
        depth = np.where(there, depth, self.nearest)
        if not clip:
            _refuse("energy", np.where(there, pir.energy, 0.0), 0.0, self.full_scale, "")
            _refuse("depth", depth, self.nearest, self.nearest + self.span, " m")
        red = np.where(there, (depth - self.nearest) / self.span, 0.0)
        green = np.where(there, np.sqrt(pir.energy / self.full_scale), 0.0)
        return np.clip(2 * np.stack([red, green, 0 * red]) - 1, -1.0, 1.0).astype(np.float32)

    def decode(self, image: ArrayLike, like: Pir, *, clip: bool = False) -> Pir:
        """PIR of an image (3, row, column) in −1 … 1, as :meth:`PirCodec.decode`."""
        x = 0.5 * (check_image(image, clip=clip) + 1)
        if x.ndim != 3:
            raise ImageRangeError(f"image has shape {x.shape}: (3, row, column) is needed")
        energy = self.full_scale * x[1] ** 2
        view = replace(like, energy=energy, time_of_arrival=energy, velocity=np.zeros_like(energy))
        distance = (self.nearest + self.span * x[0]) * _ray_over_depth(view)
        return replace(view, time_of_arrival=np.where(energy > 0, 2 * distance / SPEED_OF_LIGHT, np.nan))


def check_image(image: ArrayLike, *, clip: bool = False) -> FloatArray:
    """(…, 3, row, column) channels in −1 … 1 as float64; `clip` clips values beyond.

    Raises
    ------
    ImageRangeError
        If it has another number of channels, integers, values that are not finite, or values out of range without
        `clip`.
    """
    x = np.asarray(image)
    if x.ndim < 3 or x.shape[-3] != 3:
        raise ImageRangeError(f"image has shape {x.shape}: three channels (3, row, column) are needed")
    if np.issubdtype(x.dtype, np.integer) or x.dtype == bool:
        raise ImageRangeError(
            f"image has whole numbers ({x.dtype}): channels in −1 … 1 are needed; 8-bit values v are v / 127.5 − 1"
        )
    x = x.astype(np.float64)
    if not np.isfinite(x).all():
        raise ImageRangeError("image has values that are not finite: channels in −1 … 1 are needed")
    lowest, highest = float(x.min()), float(x.max())
    if not clip and (lowest < -1 - _TOLERANCE or highest > 1 + _TOLERANCE):
        hint = "; pictures in 0 … 1 are 2 v − 1, 8-bit ones v / 127.5 − 1" if lowest >= 0 else ""
        raise ImageRangeError(f"image has values in {lowest:.4g} … {highest:.4g}: −1 … 1 is needed{hint}")
    return np.clip(x, -1.0, 1.0)


def _ray_over_depth(pir: Pir) -> FloatArray:
    """(row, column) length of the rays through the pixels' centres over their depth along the boresight."""
    view = View.of(pir)
    if view.projection != "perspective":
        raise ValueError(f"pir.projection is {view.projection!r}: 'perspective' is needed by the authors' images")
    return np.asarray(1.0 / (view.directions @ rotation_matrix(view.orientation)[:, 0]))


def _refuse(name: str, values: FloatArray, low: float, high: float, unit: str) -> None:
    lowest, highest = float(np.min(values)), float(np.max(values))
    if not (low <= lowest and highest <= high):
        raise ImageRangeError(
            f"{name} lies in {lowest:.4g} … {highest:.4g}{unit}: {low:.4g} … {high:.4g}{unit} is allowed; clip=True "
            "clips the rest"
        )
