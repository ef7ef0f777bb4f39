"""The benchmark runs, and its figures keep to what is promised."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.benchmarks import synthesis

FASTER, ERROR, CASCADE = 150, 1e-6, 16


@pytest.mark.slow
@pytest.mark.parametrize("case", synthesis.CASES)
def test_the_synthesiser_against_the_direct_sum(case: str) -> None:
    found = synthesis.compare(case, repeats=3, parts=24)
    assert found["relative_error"] < ERROR
    assert found["times_faster"] > FASTER


@pytest.mark.slow
def test_the_cascade_takes_no_more_than_its_share() -> None:
    small, large = (
        synthesis.frame(name, preset, "people") for name, preset in (("awr1843", "mmmesh"), ("mmwcas", "ti_default"))
    )
    times: list[list[float]] = [[], []]
    for _ in range(4):  # taking turns; the first compiles
        for which, (radar, paths) in enumerate((small, large)):
            times[which].append(synthesis.timed(lambda r=radar, p=paths: synthesis.synthesize(r, p, 0.0))[0])
    assert min(times[1][1:]) < CASCADE * min(times[0][1:])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "preset"), [("awr1843", "mmmesh"), ("mmwcas", "ti_default")])
def test_memory_is_no_more_than_twice_the_output_and_the_paths(name: str, preset: str) -> None:
    found = synthesis.peak_memory(name, preset)
    if found is None:
        pytest.skip("only Linux tells the peak")
    assert found["peak"] < found["limit"]


def test_the_picture_is_drawn(tmp_path: Path) -> None:
    case = {"seconds": [0.3, 0.2], "direct_sum_seconds": [90.0, 80.0]}
    rows = [{"eps": 10.0**-n, "relative_error": 10.0 ** -(n + 1), "seconds": 0.1 * n} for n in range(2, 6)]
    result = {"cases": {"people": case}, "cascade": {"seconds": [2.0]}, "tolerances": rows}
    synthesis.draw(json.loads(json.dumps(result)), tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
