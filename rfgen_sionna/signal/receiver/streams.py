"""Random numbers: one stream for each impairment, so that switching one on leaves the others' draws alone."""

from __future__ import annotations

import zlib

import numpy as np


def device_stream(seed: int, name: str) -> np.random.Generator:
    """Draws that belong to the device and stay from frame to frame."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)))


def frame_stream(seed: int, name: str, frame: int) -> np.random.Generator:
    """Draws of one frame."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()), frame)))
