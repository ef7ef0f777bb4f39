"""Random numbers: one stream for each radar and impairment, so that none changes another's draws.

A radar is known by its name and its pose at t = 0, to the micrometre and microradian: radars of one scene draw
independently under the same seed, whatever else is simulated and in which order, and a run with the same radar and seed
draws the same again.
"""

from __future__ import annotations

import hashlib
import zlib

import numpy as np

from rfgen_sionna.radar import Radar


def _key(name: str, radar: Radar) -> tuple[int, ...]:
    place = np.rint(np.array([*radar.position, *radar.orientation]) * 1e6).astype("<i8")
    digest = hashlib.blake2b(radar.name.encode() + b"\0" + place.tobytes(), digest_size=8).digest()
    return (zlib.crc32(name.encode()), *np.frombuffer(digest, "<u4").tolist())


def device_stream(seed: int, name: str, radar: Radar) -> np.random.Generator:
    """Draws that belong to the device and stay from frame to frame."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=_key(name, radar)))


def frame_stream(seed: int, name: str, frame: int, radar: Radar) -> np.random.Generator:
    """Draws of one frame."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(*_key(name, radar), frame)))
