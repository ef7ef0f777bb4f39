"""What an imagined place returns over range, against the same kind of place furnished and traced, as ADC data.

    python tests/benchmarks/clutter.py --place "living room" --seeds 50 --traced 10 --output results/clutter.json

An AWR1843 at (0, 0, 1) looks along +x. For each seed one chirp of samples with thermal noise becomes a range profile,
over all channels and over bins of half a metre. Three sets are compared: what the image model draws for the prompt; the
images that the tracer renders of layouts of the test split, which the model never saw, sent the same way; and those
layouts traced to samples themselves, without an image in between.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.viewpoints import PlaceRenderer, Viewpoint
from rfgen_sionna.processing import range_axis, range_spectrum
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.simulation import Simulator
from training.environment.pir_data import split_of

FOV, PIXELS = 90.0, (64, 64)
EDGES = np.arange(1.0, 8.0 + 0.25, 0.5)
"""Of the range bins [m]."""


def radar_of() -> Radar:
    """An AWR1843 that sends one chirp from each antenna."""
    radar = Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(radar, waveform=replace(radar.waveform, num_loops=1))


def profile(simulator: Simulator) -> FloatArray:
    """(bin,) level [dB] of the mean power over chirps, channels and the range cells of each bin."""
    frame = next(iter(simulator.frames(simulator.radar.waveform.frame_period, noise=True, seed=simulator.seed)))
    cells = range_spectrum(frame.samples, simulator.radar)
    power = np.mean(np.abs(cells.reshape(-1, cells.shape[-1])) ** 2, axis=0)
    at = range_axis(simulator.radar, cells.shape[-1])
    return np.array([10 * np.log10(power[(at >= a) & (at < b)].mean()) for a, b in pairwise(EDGES.tolist())])


def unseen_layouts() -> Iterator[int]:
    """Seeds of layouts that no model was trained on, nor any setting chosen on."""
    return (seed for seed in range(10_000_000, 20_000_000) if split_of(seed) == "test")


def compared(drawn: FloatArray, real: FloatArray) -> dict[str, Any]:
    """Means and spreads [dB] over seeds of (seed, bin) profiles, and how far they lie apart."""
    mean, spread = (f(drawn, axis=0) - f(real, axis=0) for f in (np.mean, np.std))
    rng = np.random.default_rng(0)

    def again(profiles: FloatArray) -> FloatArray:
        """Mean of as many, drawn anew."""
        return np.asarray(profiles[rng.integers(len(profiles), size=len(profiles))].mean(axis=0))

    draws = [np.abs(again(drawn) - again(real)) for _ in range(500)]
    return {
        "seeds": [len(drawn), len(real)],
        "difference of the means [dB]": mean.round(2).tolist(),
        "difference of the spreads [dB]": spread.round(2).tolist(),
        "means: mean difference without sign [dB]": float(np.abs(mean).mean()),
        "means: mean difference without sign, 95 % [dB]": np.quantile(np.mean(draws, axis=1), [0.025, 0.975]).tolist(),
        "means: largest difference [dB]": float(np.abs(mean).max()),
        "spreads: mean difference without sign [dB]": float(np.abs(spread).mean()),
        "spreads: largest difference [dB]": float(np.abs(spread).max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--place", default="living room")
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--traced", type=int, default=10, help="layouts that are traced to samples themselves")
    parser.add_argument("--model", default=None, help="folder of a model; none: the one that ships")
    parser.add_argument("--half", action="store_true", help="draw in half precision")
    parser.add_argument("--output", type=Path, default=Path("clutter.json"))
    asked = parser.parse_args()
    radar = radar_of()

    def through_image(pir: Pir, seed: int) -> FloatArray:
        return profile(Simulator(None, radar, environment=pir, seed=seed))

    words = f"{'an' if asked.place[0] in 'aeiou' else 'a'} {asked.place}"
    view: dict[str, Any] = {"fov_deg": FOV, "position": radar.position, "orientation": radar.orientation}
    model = EnvironmentDiffusion(asked.model, half=asked.half)
    images = model.generate_many([words] * asked.seeds, seeds=range(asked.seeds), **view)
    drawn = np.array([through_image(pir, k) for k, pir in enumerate(images)])
    rendered, traced = [], []
    for k, seed in zip(range(asked.seeds), unseen_layouts(), strict=False):
        room = furnished(asked.place, seed, radar.center_frequency)
        viewpoint = Viewpoint((0.0, 0.0, 1.0), 0.0, 0.0, FOV)
        rendered.append(through_image(PlaceRenderer(room, radar).render(viewpoint, PIXELS), k))
        if k < asked.traced:
            traced.append(profile(Simulator(room, radar, rtol=1e-2, seed=k)))
            print(k, np.round(traced[-1] - rendered[-1], 1), flush=True)
    report = {
        "place": asked.place,
        "ranges [m]": EDGES.tolist(),
        "drawn, mean [dB]": drawn.mean(0).round(2).tolist(),
        "drawn, spread [dB]": drawn.std(0).round(2).tolist(),
        "rendered, mean [dB]": np.mean(rendered, axis=0).round(2).tolist(),
        "rendered, spread [dB]": np.std(rendered, axis=0).round(2).tolist(),
        "drawn against rendered images": compared(drawn, np.array(rendered)),
    }
    halves = np.array(rendered[::2]), np.array(rendered[1::2])
    report["two halves of the rendered images"] = compared(*halves)
    if traced:
        report["drawn against traced samples"] = compared(drawn, np.array(traced))
        report["rendered images against traced samples"] = compared(np.array(rendered[: len(traced)]), np.array(traced))
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    asked.output.write_text(json.dumps(report, indent=1), encoding="utf-8")
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
