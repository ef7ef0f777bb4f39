"""From sampled slots to Tx elements: profiles, beams, codes and Doppler bands."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from rfgen_sionna.processing.multiplexing import (
    Samples,
    decoder,
    entry_times,
    occupied_bins,
    separate_bands,
    uses_doppler_bands,
)
from rfgen_sionna.processing.spectrum import check_cube, complex_samples, real_samples

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


def select_profile(cube: ArrayLike, radar: Radar, profile: int) -> tuple[Samples, Radar]:
    """Chirps of the profile of index `profile`, and a radar with its Tx elements and times.

    `cube` and result are (..., chirp, tx, rx, sample). A `cube` without an entry of "tx" for each slot of the loop is a
    ValueError.
    """
    array = np.asarray(cube)
    chosen = radar.of_profile(profile)
    entries = len(radar.axis_names)
    if array.ndim < 4 or array.shape[-3] != entries:
        raise ValueError(
            f"cube has shape {array.shape}: (..., chirp, tx, rx, sample) with {entries} entries along 'tx' is needed"
        )
    return array[..., list(radar.waveform.profile_axis(profile)), :, :], chosen


def select_slot(cube: ArrayLike, radar: Radar, slot: int) -> tuple[Samples, Radar]:
    """Chirps of one slot, (..., chirp, 1, rx, sample), and a radar of a single Tx in the middle of its elements.

    The elements radiate one beam; its phase centre changes the phase of all returns alike. A ValueError is raised for
    an unknown slot, and for a radar without beams.
    """
    array = check_cube(cube, radar, tensors=True)
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
    beam = replace(radar, waveform=alone, tx_names=(name,), tx_positions=middle, tx_phases_deg=())
    return array[..., slot : slot + 1, :, :], beam


def as_beams(cube: ArrayLike, radar: Radar) -> tuple[Samples, Radar]:
    """Cube and radar, with one Tx where all elements radiate one beam; several beams are a ValueError."""
    array = check_cube(cube, radar, tensors=True)
    if radar.waveform.multiplexing != "beam":
        return array, radar
    if len(radar.waveform.slots) > 1:
        decoder(radar)  # raises
    return select_slot(array, radar, 0)


def demultiplex(cube: ArrayLike, radar: Radar) -> tuple[Samples, Radar]:
    """Cube with the separate echoes of each Tx element, and its radar.

    - TDM is unchanged: each element at the time of its slot.
    - BPM: a phase by Doppler moves each slot to the middle of the loop, and the inverse of the code gives the elements.
    - DDM: the band of each element, moved to zero Doppler, with fewer chirps over the same time.
    - One beam: one Tx.

    Velocities must be within `radar.max_velocity`. Transforms of the whole frame ring at its ends for signals that are
    not periodic. Range-Doppler maps, angles and point clouds take sampled cubes and decode in the Doppler domain.

    `cube`, of one profile, and result are (..., chirp, tx, rx, sample), the result with an entry of "tx" for each Tx
    element. The new radar has the same `max_velocity` and `velocity_resolution`. Several beams are a ValueError.
    """
    array, radar = as_beams(np.asarray(cube), radar)
    wave = radar.waveform
    if not wave.slots or wave.separated:
        return array, radar
    chirps = array.shape[-4]
    matrix = decoder(radar)
    # The other sign of the beats of real samples is in other Doppler bands.
    array = complex_samples(array, radar)
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
    data = real_samples(fft.ifft(spectrum, axis=-4) * (count / chirps), radar)
    together = replace(
        wave,
        num_loops=count,
        slots=(type(wave.slots[0])((0.0,) * wave.num_tx),),
        slot_starts=(float(times.mean()),),
        loop_time=chirps * wave.loop_period / count,
        separated=True,
    )
    return np.asarray(data), replace(radar, waveform=together)
