"""Records print in a few lines with what a user looks for, whatever their size."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.processing import point_cloud, range_doppler
from rfgen_sionna.records import AdcCube, Motion
from rfgen_sionna.signal import Coupling, Receiver
from rfgen_sionna.signal.formats import open_capture, write_capture


def check(record: Any, *facts: str) -> None:
    """The text is short and has the facts."""
    text = repr(record)
    assert len(text) < 600
    assert text.count("\n") < 9
    assert max(map(len, text.splitlines())) <= 120
    assert text.startswith(f"{type(record).__name__}(")
    joined = " ".join(text.split())
    for fact in facts:
        assert fact in joined, joined


@pytest.fixture(scope="module")
def sim(tiny_toml: Path) -> Any:
    radar = rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    actor = rfgen.Actor.from_mesh(ball, material="metal", name="ball", position=(3, 0, 1), velocity=(0.5, 0, 0))
    return rfgen.Simulator(None, radar, [actor], rtol=0.03)


def test_what_a_simulation_is_made_of(sim: Any) -> None:
    check(sim, "free space", "radar 'tiny' (tiny)", "actors ball", "rtol 0.03")
    check(
        sim.radar,
        "'tiny' (tiny)",
        "2 Tx × 4 Rx, tdm",
        "8 loops × 64 complex samples",
        "to 10.99 m",
        "50 ms",
        "(0, 0, 1) m",
    )
    check(sim.actors[0], "'ball'", "metal", "642 vertices, 1280 faces", "rigid", "(3, 0, 1) m", "(0.5, 0, 0) m/s")
    for name, presets in rfgen.Radar.available().items():
        for preset in presets:
            check(rfgen.Radar.load(name, preset), name)
            check(rfgen.Radar.load(name, preset).waveform)
    check(Receiver(coupling=Coupling.of_neighbours(sim.radar, -30.0)))
    check(sim.actors[0].sequence, "642 × 3 float64")


def test_what_it_gives(sim: Any, tmp_path: Path) -> None:
    cube = sim.adc(0.2, seed=3)
    shape = "4 frames × 8 loops × 2 Tx × 4 Rx × 64 samples, complex64 [√W]"
    check(cube, shape, "0 … 0.15 s", "cells 17.2 cm to 10.99 m and 376 cm/s to ±15.1 m/s", "seed 3")
    check(sim.paths(), "paths × 2 Tx × 4 Rx × 1 knot", "ranges 2.9", "objects ball")
    check(sim.pir(0.0, (20, 30)), "20 × 30 pixels", "60° × ", "at 2.90")
    check(next(sim.frames(0.1)), "index=0", "8 × 2 × 4 × 64")
    check(sim.tracer.trace(0.0, 0.01).report, "facets=")
    check(range_doppler(cube.data[0], sim.radar), "range=64 float64")
    check(point_cloud(cube.data[0], sim.radar))
    report = write_capture(cube, tmp_path, "dca1000")
    check(report, "dca1000")
    check(open_capture(tmp_path, radar=sim.radar), "dca1000", "4 frames", "(loops, Tx, Rx, samples)", "√W per LSB")
    with sim.record(tmp_path / "run.h5", 0.1) as run:
        check(run, "run.h5", "2 frames", "radar 'tiny'", "actors ball", "labels action, ")
        check(run.actors["ball"], "faces=1280 × 3")
    check(run, "closed")


def test_any_size_is_short(sim: Any) -> None:
    """The cube of a long run of many channels, the actor with a long name, the run with a long prompt."""
    many = AdcCube(np.broadcast_to(np.complex64(0), (5000, 8, 2, 4, 64)), sim.radar, np.arange(5000.0))
    check(many, "5000 frames", "0 … 4999 s")
    check(replace(sim.actors[0], name="x" * 5000))
    check(
        Motion(np.zeros((90, 52, 4)), np.zeros((90, 3)), 30.0, ("joint",) * 52, (-1,) * 52, np.zeros((52, 3))),
        "90 poses",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        crowd = rfgen.Simulator(
            None, sim.radar, [replace(sim.actors[0], name=f"actor number {n}", position=(3, n, 1)) for n in range(9)]
        )
    check(crowd, "and 5 more")


def test_fields_of_other_records_are_shapes_and_short_values() -> None:
    @dataclass(frozen=True, repr=False)
    class Example(ShortRepr):
        array: Any
        text: str
        missing: Any = None
        many: tuple[int, ...] = tuple(range(1000))
        _hidden: int = 1

    assert repr(Example(np.zeros((3, 4)), "a")) == "Example(array=3 × 4 float64, text='a', many=1000 entries)"
    check(Example(np.zeros(2), "word " * 1000))
    check(Example([np.zeros(99)] * 3, "x" * 1000))
