"""The comparison of two checkouts: its judgement, its meshes with other diagonals, and a run of this one by itself."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from tests.benchmarks import against
from tests.benchmarks.against_scenes import ERROR, SPEED, of_prompt, with_other_diagonals


def row(old: float, new: float) -> dict[str, object]:
    sides = {who: {"first": 10 * each, "later_median": each} for who, each in (("old", old), ("new", new))}
    return {**sides, "factor_first": old / new, "factor_later": old / new}


def test_a_scene_holds_if_all_that_is_asked_of_it_does() -> None:
    assert against._judged(row(3.2, 0.2), "walk") == (True, "later 15x, first <= 2 s")
    assert against._judged(row(3.2, 0.22), "walk")[0] is False  # 14.5 times, and 2.2 s
    assert against._judged(row(4.0, 0.21), "walk")[0] is False  # 19 times, and 2.1 s
    assert against._judged(row(9.0, 0.5), "canyon")[0] is True
    assert against._judged(row(1.0, 1.0), "tiny") == (None, None)


def test_errors_are_relative_to_what_is_true() -> None:
    true = np.array([[3.0, 4.0j], [3.0, -4.0j]]).reshape(1, 2, 1, 1, 2)
    assert against._rms(1.02 * true, true) == pytest.approx(0.02)
    moving = against._moving(true)
    np.testing.assert_array_equal(moving.ravel(), [0, 4j, 0, -4j])
    assert against._rms(against._moving(true + 1.0), moving) == 0.0


def test_other_diagonals_keep_the_shape_of_a_person() -> None:
    person = of_prompt("a person standing", None, duration=1.0)
    other, share = with_other_diagonals(person)
    assert share > 0.95
    first, second = (trimesh.Trimesh(each.vertices(0.5), each.faces, process=False) for each in (person, other))
    assert second.area == pytest.approx(first.area, rel=5e-3)
    assert second.volume == pytest.approx(first.volume, rel=5e-3)
    assert second.is_winding_consistent == first.is_winding_consistent
    again, _ = with_other_diagonals(other)
    assert {frozenset(each) for each in again.faces.tolist()} == {frozenset(each) for each in person.faces.tolist()}


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["nowhere"], "nowhere is no checkout"),
        ([".", "--scenes", "slab"], "slab: the scenes here are walk"),
        ([".", "--error", "--scenes", "dog"], "dog: the scenes here are walk"),
    ],
)
def test_refusals_name_what_there_is(
    words: list[str], named: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(against.ROOT)
    with pytest.raises(SystemExit):
        against.parsed(words)
    assert named in capsys.readouterr().err


def test_help_names_every_scene(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        against.parsed(["--help"])
    shown = capsys.readouterr().out
    assert all(each.title in shown for each in (*SPEED.values(), *ERROR.values()))


@pytest.mark.slow
def test_a_checkout_against_itself(tmp_path, capsys) -> None:
    """Equal times but for other work on the machine, and samples that differ by the tolerance at most."""
    here, file = str(against.ROOT), tmp_path / "against.json"
    given = [here, here, "--output", str(file)]
    assert against.main([*given, "--scenes", "tiny", "--frames", "3", "--repeats", "1"]) == 0
    assert against.main([*given, "--error", "--scenes", "corner", "--cache", str(tmp_path / "cache")]) == 0
    found = json.loads(file.read_text(encoding="utf-8"))
    assert 0.2 < found["speed"]["tiny"]["factor_later"] < 5
    assert len(found["speed"]["tiny"]["runs"]["new"][0]["later"]) == 3
    assert found["error"]["corner"]["generate"]["rms"] < 0.1
    assert len(list((tmp_path / "cache").glob("*-corner-0.001.npz"))) == 1
    shown = capsys.readouterr().out
    assert "tiny" in shown
    assert "corner, generate" in shown
