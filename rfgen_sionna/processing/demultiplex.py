"""From slots as the hardware samples them to Tx elements: profiles, beams, codes and Doppler bands."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from rfgen_sionna.processing.multiplexing import (
    ComplexChannels,
    decoder,
    entry_times,
    occupied_bins,
    separate_bands,
    uses_doppler_bands,
)
from rfgen_sionna.processing.spectrum import check_cube

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


def select_profile(cube: ArrayLike, radar: Radar, profile: int) -> tuple[ComplexChannels, Radar]:
    """The chirps of one profile and the radar as they see it.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample) with an entry of "tx" for each slot of the loop.
    profile
        Index of the profile.

    Returns
    -------
    cube, radar
        (..., chirp, tx, rx, sample) with the profile's slots alone; a radar with its Tx elements and its timing.
    """
    array = np.asarray(cube)
    chosen = radar.of_profile(profile)
    entries = len(radar.axis_names)
    if array.ndim < 4 or array.shape[-3] != entries:
        raise ValueError(
            f"cube has shape {array.shape}: (..., chirp, tx, rx, sample) with {entries} entries along 'tx' is needed"
        )
    return array[..., list(radar.waveform.profile_axis(profile)), :, :], chosen


def select_slot(cube: ArrayLike, radar: Radar, slot: int) -> tuple[ComplexChannels, Radar]:
    """The chirps of one slot and a radar of a single Tx, in the middle of the elements that radiate in it.

    What they radiate together is one beam; where its phase centre is changes the phase of everything alike.
    """
    array = check_cube(cube, radar)
    wave = radar.waveform
    if not wave.slots or wave.separated or uses_doppler_bands(radar):
        raise ValueError(f"preset '{radar.preset}' is multiplexed as '{wave.multiplexing}': it has no beams to select")
    if isinstance(slot, bool) or not isinstance(slot, int | np.integer) or not 0 <= slot < len(wave.slots):
        raise ValueError(f"slot is {slot!r}: a whole number in 0 … {len(wave.slots) - 1} is needed")
    on = list(wave.slots[slot].on)
    alone = replace(
        wave, slots=(), tx_order=(0,), slot_starts=(float(wave.slot_times[slot]),), loop_time=wave.loop_period
    )
    name = radar.axis_names[slot].partition(":")[2]
    middle = radar.tx_positions[on].mean(axis=0, keepdims=True)
    return array[..., slot : slot + 1, :, :], replace(radar, waveform=alone, tx_names=(name,), tx_positions=middle)


def as_beams(cube: ArrayLike, radar: Radar) -> tuple[ComplexChannels, Radar]:
    """The cube and its radar, with one Tx where all elements radiate one beam.

    Raises
    ------
    ValueError
        If there are several beams.
    """
    array = check_cube(cube, radar)
    if radar.waveform.multiplexing != "beam":
        return array, radar
    if len(radar.waveform.slots) > 1:
        decoder(radar)  # says why there is none
    return select_slot(array, radar, 0)


def demultiplex(cube: ArrayLike, radar: Radar) -> tuple[ComplexChannels, Radar]:
    """The cube that Tx elements with echoes of their own would have left, and its radar.

    - TDM stays as it is: each element at the time of its slot.
    - BPM: Doppler moves each slot to the middle of the loop, then the code's inverse gives the elements, all of them at
      that time.
    - DDM: each element's band, moved to zero Doppler, as its own series of fewer chirps over the same time.
    - One beam: one Tx.

    It assumes velocities within `radar.max_velocity`, and works by transforms of the whole frame: at its beginning and
    end signals that are not periodic in it ring. Range-Doppler maps, angles and point clouds need none of this; they
    take cubes as sampled and decode in the Doppler domain.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample) of one profile (:func:`select_profile`).

    Returns
    -------
    cube, radar
        (..., chirp, tx, rx, sample) with an entry of "tx" for each Tx element; the radar's `max_velocity` and
        `velocity_resolution` stay.
    """
    array, radar = as_beams(cube, radar)
    wave = radar.waveform
    if not wave.slots or wave.separated:
        return array, radar
    chirps = array.shape[-4]
    matrix = decoder(radar)
    spectrum = fft.fftshift(fft.fft(separate_bands(array, radar), axis=-4), axes=-4)
    frequency = fft.fftshift(fft.fftfreq(chirps, wave.loop_period))
    kept = occupied_bins(radar, chirps)
    spectrum, frequency = spectrum[..., kept, :, :, :], frequency[kept]
    times = entry_times(radar)
    turn = np.exp(-2j * np.pi * frequency[:, None] * (times - times.mean()))
    spectrum = spectrum * turn[:, :, None, None].astype(spectrum.dtype)
    if matrix is not None:
        spectrum = np.einsum("te,...ers->...trs", matrix.astype(spectrum.dtype), spectrum)
    count = len(frequency)
    # The middle bin, zero Doppler, becomes the first one.
    spectrum = np.roll(spectrum, -int(np.argmin(np.abs(frequency))), axis=-4)
    data = fft.ifft(spectrum, axis=-4) * (count / chirps)
    together = replace(
        wave,
        num_loops=count,
        slots=(type(wave.slots[0])((0.0,) * wave.num_tx),),
        slot_starts=(float(times.mean()),),
        loop_time=chirps * wave.loop_period / count,
        separated=True,
    )
    return np.asarray(data), replace(radar, waveform=together)
