"""Tubes that have no room in memory are refused before it is taken: the process would end without a word."""

from __future__ import annotations

from pathlib import Path

import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from tests.reference.sbr import memory
from tests.reference.sbr.shoot import shoot

PLATE = ([[0, -0.5, -0.5], [0, 0.5, -0.5], [0, 0.5, 0.5], [0, -0.5, 0.5]], [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(
    ("free", "message"),
    [
        (23e6, "level is 5: 8,192 tubes take 0.0246 GB of memory, 0.023 GB are free: a lower level, fewer bounces"),
        (0.0, "level is 5: 8,192 tubes take"),
    ],
)
def test_a_level_without_room_is_refused(monkeypatch, free, message):
    monkeypatch.setattr(memory, "available_memory", lambda: int(free))
    actor = MeshActor.from_mesh(PLATE, material="metal", position=(3, 0, 1))
    simulator = Simulator(None, Radar.load("awr1843", position=(0, 0, 1)), [actor])
    with pytest.raises(ValueError, match=message):
        shoot(simulator.tracer, sampling="uniform", level=5)
    assert shoot(simulator.tracer, rtol=0.03).paths.num_paths > 0  # adaptive tubes are as many as they need


@pytest.mark.parametrize(
    ("after", "message"),
    [(1, r"level is 5: \d+ paths of 12 pairs of elements take"), (2, r"\d+ tubes that go on beyond surface 1 take")],
)
def test_memory_is_asked_for_again_on_the_way(monkeypatch, after, message):
    """By how many tubes meet something, and how many elements see them."""
    left = iter([10**12] * after)
    monkeypatch.setattr(memory, "available_memory", lambda: next(left, 0))
    actor = MeshActor.from_mesh(PLATE, material="metal", position=(3, 0, 1))
    simulator = Simulator(None, Radar.load("awr1843", position=(0, 0, 1)), [actor])
    with pytest.raises(ValueError, match=message):
        shoot(simulator.tracer, sampling="uniform", level=5, max_bounces=2)


def test_the_limit_of_a_container_counts(monkeypatch, tmp_path: Path):
    monkeypatch.setattr(memory, "_CGROUP", tmp_path)
    machine = memory.available_memory()
    assert machine is None or machine > 1e6
    (tmp_path / "memory.max").write_text("max\n")
    (tmp_path / "memory.current").write_text("700\n")
    (tmp_path / "memory.stat").write_text("anon 5\ninactive_file 200\n")
    assert (memory.available_memory() is None) == (machine is None)
    (tmp_path / "memory.max").write_text("1000\n")
    assert memory.available_memory() == 500
