"""Entries of the axis "tx" of a cube, and the share of each Tx element in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

ComplexChannels = NDArray[np.complexfloating[Any, Any]]


def uses_doppler_bands(radar: Radar) -> bool:
    """Whether the Tx elements share a slot in Doppler bands of their own (DDM)."""
    return radar.waveform.multiplexing == "ddm"


def axis_lengths(radar: Radar) -> tuple[int, ...]:
    """Lengths that the axis "tx" of cubes may have: entries as sampled; of a DDM frame also Tx elements told apart.

    Raises
    ------
    ValueError
        If the radar has several profiles, whose chirps don't belong into one spectrum.
    """
    if radar.waveform.other_profiles:
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' has {len(radar.waveform.profiles)} profiles: take the "
            "chirps of one, processing.select_profile(cube, radar, 0)"
        )
    entries = len(radar.axis_names)
    return (entries, radar.waveform.num_tx) if uses_doppler_bands(radar) else (entries,)


def separate_bands(cube: ComplexChannels, radar: Radar) -> ComplexChannels:
    """(..., chirp, tx, rx, sample) with an entry for each Tx element, at the middle of its Doppler band.

    That is for frames in Doppler bands; others stay as they are. Outside of its band, which
    :func:`~rfgen_sionna.processing.spectrum.range_doppler` keeps alone, each entry holds the other elements' echoes.
    """
    if not uses_doppler_bands(radar) or cube.shape[-3] == radar.waveform.num_tx > 1:
        return cube
    weights = radar.waveform.axis_weights[:, 0]  # what is radiated; the samples hold its conjugate
    loops = cube.shape[-4]
    if len(weights) < loops:
        weights = np.resize(weights, (loops, weights.shape[1]))
    return np.asarray(cube * weights[:loops, :, None, None].astype(cube.dtype))


def entry_times(radar: Radar) -> FloatArray:
    """(entry,) start of the ramps that entries of (separated) cubes are sampled in, within the loop [s]."""
    if uses_doppler_bands(radar):
        return np.zeros(radar.waveform.num_tx)
    return np.asarray(radar.waveform.chirp_times[0])


def decoder(radar: Radar) -> ComplexArray | None:
    """(tx, entry) matrix that takes entries at the same instant to Tx elements; None where they are that already.

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
            "slot: the Tx elements cannot be told apart; take one slot, processing.select_slot(cube, radar, 0), for "
            "directions from the Rx elements"
        )
    return np.asarray(np.linalg.pinv(np.conj(wave.axis_weights[0])))


def empty_bands(radar: Radar) -> int:
    """Number of empty Doppler bands (DDM); 0 elsewhere."""
    return round(radar.waveform.doppler_bands) - radar.waveform.num_tx if uses_doppler_bands(radar) else 0


def occupied_bins(radar: Radar, bins: int) -> slice:
    """The Doppler bins that a Tx element has to itself, of `bins` bins in ascending order."""
    if not uses_doppler_bands(radar):
        return slice(None)
    count = max(1, int(bins / radar.waveform.doppler_bands + 1e-9))
    first = bins // 2 - count // 2
    return slice(first, first + count)
