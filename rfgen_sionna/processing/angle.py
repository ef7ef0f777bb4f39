"""Directions of arrival from the virtual array of a MIMO radar.

Arrays need not be regular. Directions are in the device frame (boresight +x, y to the left, z up): azimuth atan2(y, x)
grows to the left, elevation asin(z) upwards. The path of the channel (tx, rx) to a target in direction u at a distance
R is |R u - p_tx| + |R u - p_rx|, far away 2 R - (p_tx + p_rx) . u; the phase of the beat signal is +k times that path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.array_namespace import complex_type, constant
from rfgen_sionna.processing.multiplexing import ComplexChannels, decoder, entry_times

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


def unit_vectors(azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
    """(..., 3) unit vectors in the device frame of broadcast angles [rad]."""
    az, el = np.broadcast_arrays(np.asarray(azimuth, np.float64), np.asarray(elevation, np.float64))
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)


def steering(radar: Radar, direction: FloatArray, distance: FloatArray | None = None) -> NDArray[np.complex128]:
    """(..., tx, rx) phase factors of targets in `direction` (..., 3), unit vectors, relative to the frame's origin.

    Phases of the elements' feeds are included. The wave front is a sphere of radius `distance` (...) [m]; None takes a
    plane one.
    """
    wavenumber = 2 * np.pi / radar.wavelength
    if distance is None:
        path = -np.einsum("trk,...k->...tr", radar.virtual_positions, direction)
    else:
        away = np.asarray(distance, np.float64)[..., None]
        point = (direction * away)[..., None, :]
        out = np.linalg.norm(point - radar.tx_positions, axis=-1) - away
        back = np.linalg.norm(point - radar.rx_positions, axis=-1) - away
        path = out[..., :, None] + back[..., None, :]
    tx_feeds, rx_feeds = radar.feed_factors
    return np.exp(1j * wavenumber * path) * np.conj(tx_feeds[:, None] * rx_feeds)


def compensate_tdm(channels: ComplexChannels, radar: Radar, velocity: ArrayLike) -> ComplexChannels:
    """Channels without the Doppler phase of each slot's time, decoded to Tx elements.

    Parameters
    ----------
    channels
        (..., tx, rx) values of one Doppler bin each, an array or a tensor, with the axis "tx" of
        :func:`~rfgen_sionna.processing.spectrum.range_doppler`; the result has the Tx elements of the radar.
    velocity
        (...) radial velocity [m/s] of that bin, positive receding. Multiples of `2 radar.max_velocity` added to it are
        other Doppler ambiguities, with the same spectrum and other channels.
    """
    delay = entry_times(radar)
    frequency = 2 * np.asarray(velocity, np.float64) / radar.wavelength
    precision = complex_type(channels)
    turn = np.exp(-2j * np.pi * frequency[..., None] * delay).astype(precision)
    # Entries are (velocity, tx, rx) or (..., tx, rx): the turn has an axis for each but the last.
    turned: ComplexChannels = channels * constant(turn, channels)[..., None]
    matrix = decoder(radar)
    return turned if matrix is None else constant(matrix.astype(precision), channels) @ turned


@dataclass(frozen=True, repr=False)
class Directions(ShortRepr):
    """Direction estimates, one per channel vector."""

    azimuth: FloatArray
    """(n,) [rad], positive to the left."""
    elevation: FloatArray
    """(n,) [rad], positive upwards; 0 where the array has one row only."""
    velocity: FloatArray
    """(n,) [m/s] given radial velocity, or its ambiguity of most beam power."""
    power: FloatArray
    """(n,) power of the beam in that direction: that of one channel for a single target."""

    def replaced(self, mask: NDArray[np.bool_], other: Directions) -> Directions:
        """Estimates of `other` where `mask` (n,) is set, else the own ones."""
        pairs = zip(vars(other).values(), vars(self).values(), strict=True)
        return Directions(*(np.where(mask, new, old) for new, old in pairs))

    def selected(self, mask: NDArray[np.bool_]) -> Directions:
        """Estimates where `mask` (n,) is set."""
        return Directions(*(values[mask] for values in vars(self).values()))


def find_directions(
    channels: ComplexChannels,
    radar: Radar,
    velocity: ArrayLike,
    *,
    distance: ArrayLike | None = None,
    ambiguities: int = 0,
) -> Directions:
    """Strongest direction of each channel vector: the peak of the beam over all element positions.

    For one target this is the maximum-likelihood estimate. A search over direction cosines, in steps of a quarter beam
    width, precedes a local search down to 1/500 of a beam width. Where the beam is strongest beyond the horizon, with
    direction cosines of u² + v² > 1, the estimate is at 90° from boresight.

    Parameters
    ----------
    channels
        (n, tx, rx) values of the peaks of :func:`~rfgen_sionna.processing.spectrum.range_doppler`.
    velocity
        (n,) radial velocity [m/s] of each peak.
    distance
        (n,) radius of a spherical wave front [m], for (aperture)² / (8 distance) near λ/16; None takes a plane one.
    ambiguities
        Largest multiple of `2 radar.max_velocity` that is added to `velocity` on either side; the strongest beam
        counts. More than 0 needs several Tx elements in different slots.

    Raises
    ------
    ValueError
        For another shape of `channels`, or ambiguities without several slots.
    """
    channels = np.asarray(channels)
    count = len(channels)
    shape = (len(entry_times(radar)), len(radar.rx_positions))
    if channels.ndim != 3 or channels.shape[1:] != shape:
        raise ValueError(f"channels have shape {channels.shape}: (n, tx, rx) = (n, {shape[0]}, {shape[1]}) is needed")
    if ambiguities < 0 or (ambiguities > 0 and radar.waveform.num_slots == 1):
        raise ValueError(
            f"ambiguities is {ambiguities}: 0 or more is needed, and more than 0 only with several slots "
            f"(radar '{radar.name}' has {radar.waveform.num_slots})"
        )
    speed = np.broadcast_to(np.asarray(velocity, np.float64), (count,))
    away = None if distance is None else np.broadcast_to(np.asarray(distance, np.float64), (count,))
    best = Directions(np.zeros(count), np.zeros(count), speed.copy(), np.full(count, -np.inf))
    for fold in sorted(range(-ambiguities, ambiguities + 1), key=abs):
        trial = speed + 2 * fold * radar.max_velocity
        found = _search(compensate_tdm(channels.astype(np.complex128), radar, trial), radar, away)
        # A tie, as of opposite folds with two slots of a code, goes to the smaller speed.
        as_good = found[2] > best.power * (1 - 1e-6)
        better = (found[2] > best.power * (1 + 1e-6)) | (as_good & (np.abs(trial) < np.abs(best.velocity)))
        better = better if fold else np.ones(count, bool)
        best = best.replaced(better, Directions(found[0], found[1], trial, found[2]))
    return best


def _search(
    channels: ComplexChannels, radar: Radar, distance: FloatArray | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    count, elements = len(channels), channels.shape[1] * channels.shape[2]
    flat = channels.reshape(count, elements)
    position = radar.virtual_positions.reshape(-1, 3)
    extent = np.ptp(position, axis=0)
    step = np.zeros(2)
    grids = []
    for axis in (1, 2):
        if extent[axis] < radar.wavelength / 20:
            grids.append(np.zeros(1))
            continue
        # Four steps a beam width of wavelength / aperture; the sum of positions counts one way.
        half = int(np.ceil(4 * (extent[axis] + radar.wavelength / 2) / radar.wavelength))
        step[axis - 1] = 1 / half
        grids.append(np.linspace(-1, 1, 2 * half + 1))
    uy, uz = (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij"))
    visible = uy**2 + uz**2 <= 1
    uy, uz = uy[visible], uz[visible]
    beams = steering(radar, _direction(uy, uz)).reshape(len(uy), elements).conj()
    cosines, rivals = np.empty((count, 2)), np.empty((count, 2))
    rivalled = np.zeros(count, dtype=bool)
    grid = np.stack([uy, uz], axis=1)
    for start in range(0, count, 256):
        part = slice(start, start + 256)
        response = np.abs(flat[part] @ beams.T)
        first = response.argmax(axis=1)
        cosines[part], best = grid[first], response.max(axis=1)
        # A true peak between grid points may be lower there than a grating lobe on one: both are refined.
        response[(np.abs(grid - grid[first][:, None]) <= 2.5 * np.maximum(step, 1e-9)).all(axis=-1)] = 0.0
        rivals[part] = grid[response.argmax(axis=1)]
        rivalled[part] = response.max(axis=1) > 0.7 * best
    owner = np.concatenate([np.arange(count), np.flatnonzero(rivalled)])
    cosines, power = _refine(
        np.concatenate([cosines, rivals[rivalled]]),
        step,
        flat[owner],
        None if distance is None else distance[owner],
        radar,
    )
    # Of equal peaks, as of an array with wide gaps, the one nearer to boresight counts.
    better = power[count:] > power[owner[count:]] * (1 + 1e-3)
    as_good = power[count:] > power[owner[count:]] * (1 - 1e-3)
    nearer = np.linalg.norm(cosines[count:], axis=1) < np.linalg.norm(cosines[owner[count:]], axis=1)
    for index in count + np.flatnonzero(better | (as_good & nearer)):
        cosines[owner[index]], power[owner[index]] = cosines[index], power[index]
    u = _direction(cosines[:count, 0], cosines[:count, 1])
    return np.arctan2(u[:, 1], u[:, 0]), np.arcsin(np.clip(u[:, 2], -1, 1)), power[:count]


def _refine(
    cosines: FloatArray, step: FloatArray, flat: ComplexChannels, distance: FloatArray | None, radar: Radar
) -> tuple[FloatArray, FloatArray]:
    """Direction cosines (n, 2) of the nearest peak of the beam, and its power (n,); `step` is (2,)."""
    count, elements = flat.shape
    offset = np.array([(a, b) for a in (-1, -0.5, 0, 0.5, 1) for b in (-1, -0.5, 0, 0.5, 1)])
    power = np.empty(count)
    for _ in range(8):
        trial = cosines[:, None, :] + offset * step
        # Stay on the visible half sphere.
        trial /= np.maximum(1.0, np.linalg.norm(trial, axis=-1, keepdims=True))
        away = None if distance is None else np.broadcast_to(distance[:, None], trial.shape[:2])
        beam = steering(radar, _direction(trial[..., 0], trial[..., 1]), away).reshape(count, len(offset), elements)
        response = np.abs(np.einsum("ndc,nc->nd", beam.conj(), flat))
        pick = response.argmax(axis=1)
        cosines = np.take_along_axis(trial, pick[:, None, None], axis=1)[:, 0]
        power = np.square(np.take_along_axis(response, pick[:, None], axis=1)[:, 0] / elements)
        step = step / 2
    return cosines, power


def _direction(uy: FloatArray, uz: FloatArray) -> FloatArray:
    return np.stack([np.sqrt(np.maximum(0.0, 1 - uy**2 - uz**2)), uy, uz], axis=-1)
