"""Entries of the axis "tx" of a cube, and the part of each Tx element in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.processing.array_namespace import complex_type, constant

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

ComplexChannels = NDArray[np.complexfloating[Any, Any]]
Samples = NDArray[np.inexact[Any]]
"""Complex samples, or real ones of a real ADC."""


def uses_doppler_bands(radar: Radar) -> bool:
    """Whether the Tx elements share a slot in different Doppler bands (DDM)."""
    return radar.waveform.multiplexing == "ddm"


def axis_lengths(radar: Radar) -> tuple[int, ...]:
    """Allowed lengths of the axis "tx" of a cube: sampled entries, or separate Tx elements of a DDM frame.

    Raises
    ------
    ValueError
        If the radar has several profiles, which have no common spectrum.
    """
    if radar.waveform.other_profiles:
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' has {len(radar.waveform.profiles)} profiles: take the "
            "chirps of one, processing.select_profile(cube, radar, 0)"
        )
    entries = len(radar.axis_names)
    return (entries, radar.waveform.num_tx) if uses_doppler_bands(radar) else (entries,)


def separate_bands(cube: Samples, radar: Radar) -> Samples:
    """(..., chirp, tx, rx, sample) with an entry for each Tx element, its Doppler band around zero.

    Frames without Doppler bands are unchanged. Outside of its band each entry has the other elements' echoes;
    :func:`~rfgen_sionna.processing.spectrum.range_doppler` keeps the band alone.
    """
    if not uses_doppler_bands(radar) or cube.shape[-3] == radar.waveform.num_tx > 1:
        return cube
    weights = radar.waveform.axis_weights[:, 0]  # of the radiated wave; the samples have its conjugate
    loops = cube.shape[-4]
    if len(weights) < loops:
        weights = np.resize(weights, (loops, weights.shape[1]))
    turns = constant(weights[:loops, :, None, None].astype(complex_type(cube)), cube)
    return cube * turns


def entry_times(radar: Radar) -> FloatArray:
    """(entry,) start of the ramp of each entry of a (separated) cube, within the loop [s]."""
    if uses_doppler_bands(radar):
        return np.zeros(radar.waveform.num_tx)
    return np.asarray(radar.waveform.chirp_times[0])


def decoder(radar: Radar) -> ComplexArray | None:
    """(tx, entry) matrix from entries at the same time to Tx elements; None for entries that are Tx elements.

    Raises
    ------
    ValueError
        If the elements radiate as one beam.
    """
    wave = radar.waveform
    if not wave.slots or wave.separated or uses_doppler_bands(radar):
        return None
    if wave.multiplexing == "beam":
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' radiates a beam of {', '.join(radar.tx_names)} in each "
            "slot, without separate Tx elements: take one slot, processing.select_slot(cube, radar, 0), for directions "
            "from the Rx elements"
        )
    return np.asarray(np.linalg.pinv(np.conj(wave.axis_weights[0])))


def empty_bands(radar: Radar) -> int:
    """Number of empty Doppler bands (DDM); 0 without bands."""
    return round(radar.waveform.doppler_bands) - radar.waveform.num_tx if uses_doppler_bands(radar) else 0


def occupied_bins(radar: Radar, bins: int) -> slice:
    """Doppler bins of a single Tx element, of `bins` bins in ascending order."""
    if not uses_doppler_bands(radar):
        return slice(None)
    count = max(1, int(bins / radar.waveform.doppler_bands + 1e-9))
    first = bins // 2 - count // 2
    return slice(first, first + count)
