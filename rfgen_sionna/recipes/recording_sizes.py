"""Size of a recording before compression, from the recipe alone, so that shards have the same recordings anywhere."""

from __future__ import annotations

import math

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.recipe_contents import RecipeContents
from rfgen_sionna.recipes.recipe_error import faults_of
from rfgen_sionna.recipes.set_radars import load_radar
from rfgen_sionna.signal import Receiver
from rfgen_sionna.signal.receiver.receiver_record import chosen_receiver

WORD_BITS = 16
"""Most bits of an ADC whose samples are stored as 16-bit words."""
IMAGE_PIXELS = (128, 128)
"""Rows and columns of images without a size in the recipe."""
ACTOR_BYTES = {"vertices": 14_000 * 12, "body": 10_000, "joints": 300, "labels": 300}
"""What is kept -> size for each actor and frame [bytes], rounded up; vertices are those of a person."""
FRAME_BYTES = {"point_cloud": 40_000, "micro_doppler": 40_000, "drai": 4_096, "paths": 20_000_000}
"""What is kept -> size for each frame [bytes], rounded up."""
FIXED_BYTES = 200_000
"""Size of settings, axes and names of a recording [bytes]."""


def quantised(receiver: Receiver, radar: Radar) -> bool:
    """Whether samples are words of at most `WORD_BITS` bits."""
    adc = radar.adc if receiver.adc == "radar" else receiver.adc
    return adc is not None and adc.bits <= WORD_BITS


def samples_bytes(radar: Radar, words: bool) -> int:
    """Size of the samples of a frame [bytes]."""
    if not words:
        return int(np.dtype(radar.sample_type).itemsize * math.prod(radar.frame_shape))
    parts = 2 if np.dtype(radar.sample_type).kind == "c" else 1
    return 2 * parts * math.prod(radar.frame_shape)


def recording_bytes(recipe: RecipeContents) -> float:
    """Size of the largest recording of a recipe before compression, about [bytes].

    Raises:
        RecipeError: a radar or receiver cannot be loaded.
    """
    tables, total = recipe.tables, float(FIXED_BYTES)
    actors = max(map(int, tables.people.values)) * max(len(each.actions) for each in recipe.sources)
    duration = max(tables.duration_s.values)
    rows, columns = tables.pir_resolution or IMAGE_PIXELS
    for each in recipe.radars:
        with faults_of(each.path("radar")):
            radar = load_radar(each.placements()[0])
        with faults_of("receiver"):
            words = all(quantised(chosen_receiver(one, radar, tables.noise), radar) for one in recipe.receivers.values)
        frame = float(sum(FRAME_BYTES.get(name, 0) + actors * ACTOR_BYTES.get(name, 0) for name in tables.keep))
        if "adc" in tables.keep:
            frame += samples_bytes(radar, words)
        if "range_doppler" in tables.keep:
            chirps, _, _, samples = radar.frame_shape
            frame += 4 * chirps * samples
        if "pir" in tables.keep:
            frame += 12 * rows * columns
        total += frame * max(1.0, math.floor(duration / radar.waveform.frame_period + 1e-9))
    return total
