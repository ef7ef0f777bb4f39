"""RadHAR's board and what stands around the people: furnished rooms, and the clutter of a floor.

    python -m experiments.radhar.surroundings --output FOLDER --rooms 6

writes the noise-free samples of empty rooms; rooms that exist are kept.

The recordings have the floor's return from straight below at 1.31 m, and heights of walkers do not depend on their
distance: the board stood 1.31 m high and level. Weak points are seen up to that distance alone. Beyond it the floor's
diffuse return, which stands, leaks through the Doppler window into the bins next to 0.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar

HEIGHT_M = 1.31
"""Height of the radar over the floor [m]."""
FLOOR_DB = -8.0
"""Backscatter of the floor [dB]: its cross-section per area is that times the sine of the grazing angle."""
SIDE_LOBES_DB = 16.0
"""Side lobes of an element below its peak [dB], towards the floor."""
PLACES = ("lab", "office", "living room", "classroom", "bedroom", "garage")
"""Furnished rooms, in turn."""
_PATCHES, _REACH_M = 4000, 9.5


def radhar_radar() -> Radar:
    """The IWR1443 in RadHAR's configuration, at its height."""
    return Radar.load("iwr1443boost", preset="radhar", position=(0.0, 0.0, HEIGHT_M), look_at=(3.0, 0.0, HEIGHT_M))


def floor_clutter(radar: Radar, seed: int, backscatter_db: float = FLOOR_DB) -> NDArray[np.complex64]:
    """(tx, rx, sample) noise-free samples [sqrt(W)] of a rough floor below a level radar, the same in every chirp.

    Patches of equal area, at random places, return complex Gaussian amplitudes by the radar equation.
    """
    rng = np.random.default_rng(np.random.SeedSequence([54, 1, seed]))
    distance = np.sqrt(HEIGHT_M**2 + rng.uniform(0.0, 1.0, _PATCHES) * (_REACH_M**2 - HEIGHT_M**2))
    azimuth, ahead = rng.uniform(-np.pi / 2, np.pi / 2, _PATCHES), np.sqrt(distance**2 - HEIGHT_M**2)
    place = np.stack([ahead * np.cos(azimuth), ahead * np.sin(azimuth), np.full(_PATCHES, -HEIGHT_M)], axis=1)
    area = np.pi / 2 * (_REACH_M**2 - HEIGHT_M**2) / _PATCHES
    gain_db = np.maximum(radar.pattern.gain_db(place / distance[:, None]), radar.pattern.peak_gain_dbi - SIDE_LOBES_DB)
    section = 10 ** (backscatter_db / 10) * HEIGHT_M / distance * area
    power = 10 ** ((radar.tx_power_dbm - 30 + 2 * gain_db) / 10) * radar.wavelength**2 * section
    power /= (4 * np.pi) ** 3 * distance**4
    amplitude = np.sqrt(power / 2) * (rng.standard_normal(_PATCHES) + 1j * rng.standard_normal(_PATCHES))
    out, back = (
        np.linalg.norm(place[:, None] - elements, axis=-1) for elements in (radar.tx_positions, radar.rx_positions)
    )
    cycles = (out[:, :, None] + back[:, None, :]) * (radar.waveform.start_frequency / SPEED_OF_LIGHT)
    beat = 2 * distance * (radar.waveform.slope / SPEED_OF_LIGHT)
    tones = np.exp(2j * np.pi * beat[:, None] * radar.waveform.sample_times)
    channels = amplitude[:, None, None] * np.exp(2j * np.pi * cycles)
    return np.einsum("ptr,ps->trs", channels, tones, optimize=True).astype(np.complex64)


def empty_rooms(count: int, folder: Path, rtol: float) -> None:
    """Write (chirp, tx, rx, sample) noise-free samples of `count` furnished rooms without people."""
    from rfgen_sionna.scene.furnished import furnished

    radar = radhar_radar()
    for number in range(count):
        file = folder / f"room-{number:03d}.npy"
        if not file.exists():
            place = PLACES[number % len(PLACES)]
            scene = furnished(place, number, radar.center_frequency)
            simulator = rfgen.Simulator(scene, radar, [], rtol=rtol)
            np.save(file, simulator.adc(radar.waveform.frame_period, noise=False).data[0].astype(np.complex64))
            print(file.name, place, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="folder for the samples")
    parser.add_argument("--rooms", type=int, default=6, help="number of rooms")
    parser.add_argument("--rtol", type=float, default=0.1)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    empty_rooms(arguments.rooms, arguments.output, arguments.rtol)


if __name__ == "__main__":
    main()
