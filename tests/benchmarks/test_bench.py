"""The benchmark in short: errors, and times relative to a baseline in the same run, against the limits that are stored.

`limits.json` holds them. Times are the shortest of turns that the methods take one after the other, so that a busy
machine disturbs both. A change that is slower or less accurate fails here; one that is faster or more accurate may
tighten the limits.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rfgen_sionna import cli
from rfgen_sionna.cli import benchmark as bench_command
from tests.benchmarks import bench, claims, comparison, pareto, pictures, skips, synthesis, tables
from tests.benchmarks.errors import AdcCheck, Known, floor_db, spurious
from tests.benchmarks.measuring import default_rtol, exponent, timed
from tests.benchmarks.methods import Beams, Lines, Method, Samples, Traced
from tests.benchmarks.subjects import SUBJECTS, Subject, sphere

LIMITS = json.loads((Path(__file__).parent / "limits.json").read_text(encoding="utf-8"))
STEPS = 1e-3 * np.arange(4)


def hold(name: str, found: float) -> None:
    """Fail with a sentence where `found` is on the wrong side of its limit."""
    limit = LIMITS[name]
    if "most" in limit:
        assert found <= limit["most"], f"{name}: {found:.3g}, at most {limit['most']:g} is allowed ({limit['of']})"
    else:
        assert found >= limit["least"], f"{name}: {found:.3g}, at least {limit['least']:g} is needed ({limit['of']})"


@cache
def subject(name: str) -> Subject:
    return SUBJECTS[name](77)


def of(method: Method, what: Subject) -> dict[str, float]:
    return Known(what, STEPS).errors(method, np.array([method(float(t)) for t in STEPS]))


def in_turns(*methods: Method, turns: int = 4) -> list[float]:
    """Shortest time of an instant of each."""
    times: list[list[float]] = [[] for _ in methods]
    for method in methods:
        method(0.0)
    for turn in range(turns):
        for index, method in enumerate(methods):
            times[index].append(timed(lambda method=method, turn=turn: method(1e-3 * (turn + 1)))[0])
    return [min(each) for each in times]


def test_a_sphere_is_far_more_accurate_than_one_sample_per_pixel_for_the_same_time() -> None:
    ours = Traced(sphere(77, 4), 1e-3)
    theirs = Samples(subject("sphere"), 1024, False, pareto.PUBLISHED_VIEW)
    mine, other = of(ours, ours.subject), of(theirs, theirs.subject)
    hold("sphere: relative error", mine["relative"])
    hold("sphere: phase error [deg]", mine["phase_deg"])
    hold("sphere: error of one sample per pixel to ours", other["relative"] / mine["relative"])
    hold("sphere: phase error of one sample per pixel to ours", other["phase_deg"] / mine["phase_deg"])
    a, b = in_turns(ours, theirs)
    hold("sphere: our time to that of a million samples", a / b)


def test_a_translating_sphere_has_no_doppler_of_its_own() -> None:
    hold("sphere: Doppler floor [dB]", spurious(Traced(sphere(77, 3), 1e-3)))


@pytest.mark.parametrize("name", ["plate", "dihedral", "trihedral", "hand"])
def test_other_scenes_keep_to_their_truth(name: str) -> None:
    what = subject(name)
    found = of(Traced(what, 1e-3), what)
    hold(f"{name}: relative error", found["relative"])
    hold(f"{name}: phase error [deg]", found["phase_deg"])


def test_samples_of_the_adc_keep_to_the_truth() -> None:
    what = subject("hand")
    hold("hand: relative error of ADC samples", AdcCheck(what, 0, 4)(Traced(what, 1e-3))["adc_relative"])


def test_beams_keep_to_the_truth() -> None:
    what = subject("plate")
    hold("plate: relative error of beams", of(Beams(what, 128), what)["relative"])


def test_the_synthesiser_is_far_faster_than_the_direct_sum() -> None:
    found = synthesis.compare("people", repeats=2, parts=4)
    hold("synthesis: relative error", found["relative_error"])
    hold("synthesis: times faster than the direct sum", found["times_faster"])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:materials extrapolated")
@pytest.mark.parametrize("make", skips.rows(False).values(), ids=skips.rows(False))
def test_without_a_skip_the_answer_is_the_same_to_the_tolerance(make: Any) -> None:
    for found in make():
        assert found["holds"], found


# -- the benchmark itself ---------------------------------------------------------------------------------------------


def test_one_sample_per_pixel_tends_to_the_truth() -> None:
    """The baseline is the integral's Riemann sum: with rays enough it is right, so that nothing else is held against
    it."""
    what = subject("plate")
    few, many = (of(Samples(what, pixels), what)["relative"] for pixels in (64, 1024))
    assert many < 0.005
    assert many < 0.5 * few


def test_the_floor_is_that_of_what_is_added() -> None:
    """A line, and 60 dB under it another one far away."""
    times = 1e-3 * np.arange(250)
    line = np.exp(-2j * np.pi * 263.9 * times) + 1e-3 * np.exp(2j * np.pi * 100.0 * times)
    assert floor_db(line, 1e-3, 0.5, 79.1e9) == pytest.approx(-60.0, abs=0.5)


def test_exponents_are_found() -> None:
    assert exponent([1, 10, 100, 1000], [1.0, 1.1, 10.0, 1000.0]) == pytest.approx(2.0)


def fake() -> dict[str, Any]:
    def row(method: str, seconds: float, relative: float, **more: Any) -> dict[str, Any]:
        return {
            "method": method, "seconds": seconds, "first_seconds": 1.0, "peak_mb": None, "relative": relative,
            "level_db": 8 * relative, "phase_deg": 50 * relative, **more,
        }  # fmt: skip

    rows = [row("tracer", 0.02, 1e-3, rtol=1e-3), row("tracer", 0.01, 2e-2, rtol=1e-2)]
    for pixels, seconds, relative in ((128, 0.005, 3.0), (1024, 0.08, 0.75), (4096, 1.28, 0.1875)):
        rows.append(row("one sample per pixel", seconds, relative, rays=pixels**2, view_deg=60.0))
        rows.append(row("one sample per pixel", seconds, relative / 3, rays=pixels**2, view_deg=20.0))
    scene = {
        "scene": "sphere", "band_ghz": 77, "title": "t", "truth": "u", "truth_own_error": 1e-4, "rows": rows,
        "left_out": [{"method": "one sample per pixel", "rays": 8192**2}], "comparison": {},
    }  # fmt: skip
    return {
        "command": "rfgen bench", "machine": {"processor": "p", "cores": 2, "variant": "v"}, "load": [0.1],
        "versions": {"python": "3"}, "code": {"commit": "abcdef0", "digest": "x"}, "default_rtol": 1e-3, "seed": 0,
        "scenes": [scene], "open": ["skips: a"],
        "scaling": {"rays": {"of": "o", "sizes": [1, 10], "seconds": [1.0, 10.0], "exponent": 1.0}},
        "skips": [
            skips._row("a", 1.0, 2.0, (0.0, 1e-4), 1e-3, of="x"), skips._row("b", 1.0, 3.0, (0.1, 0.0), 1e-3, of="x"),
        ],
    }  # fmt: skip


def test_methods_are_compared_at_equal_time_and_at_equal_error() -> None:
    """By hand: from 5 to 80 ms the baseline's error falls from 3 to 0.75, a power of -1/2: at 20 ms it is 1.5."""
    found = comparison.compare(fake()["scenes"][0]["rows"], 1e-3)
    assert found["published"]["equal_time_ratio"] == pytest.approx(1500)
    assert found["tight"]["equal_time_ratio"] == pytest.approx(500)
    # 1 dB and 10 degrees are errors of 1/8 and 1/5: the wide view does not get there, the tight one at its end.
    assert not found["published"]["baseline_reaches_it"]
    assert found["published"]["equal_error_ratio"] == pytest.approx(128)
    assert found["tight"]["baseline_reaches_it"]
    assert found["tight"]["equal_error_their_seconds"] == pytest.approx(0.08 * 2**2)
    text = comparison.sentences(found)
    assert "at equal time: error 1.5e+03 times smaller at the default tolerance" in text[0]
    assert "more than 128 times faster, as it does not get there with 16,777,216 rays" in text[0]
    assert "(1 dB, 10°): 32 times faster." in text[1]


def test_frames_are_compared_at_equal_time_and_at_equal_error() -> None:
    """By hand; each way of the baseline by itself."""
    rows = [
        {"way": "tracer", "rtol": 1e-3, "seconds": 0.4, "relative": 1e-3},
        {"way": "tracer", "rtol": 1e-1, "seconds": 0.1, "relative": 0.1},
        *({"way": "a", "rays": n**2, "seconds": 0.1 * n, "relative": 3 / n} for n in (1, 4, 16)),
        {"way": "b", "rays": 9, "seconds": 0.2, "relative": 0.5},
    ]
    found = comparison.compare_frames(rows, 1e-3)
    assert found["a"]["equal_time_ratio"] == pytest.approx(750)
    assert found["a"]["equal_error_ratio"] == pytest.approx(0.1 * 3 / 0.22 / 0.1)
    assert found["a"]["baseline_reaches_it"]
    assert found["b"]["equal_error_ratio"] == pytest.approx(2.0)
    assert not found["b"]["baseline_reaches_it"]
    assert found["b"]["equal_time_ratio"] == pytest.approx(500)
    assert comparison.compare_frames(rows[2:], 1e-3) == {}


def test_lines_between_samples_are_samples_at_their_instants() -> None:
    """And half way, of pixels that hit at both, the mean: what moves along the line of sight is on it."""
    what = subject("plate")
    samples, step = Samples(what, 64), 4e-3
    between = Lines(samples, 3, 2 * step)
    for t in (0.0, step, 2 * step):
        for found, expected in zip(between.returns(t), samples.returns(t), strict=True):
            assert np.allclose(np.sort_complex(found), np.sort_complex(expected), rtol=1e-6)
    half = between(1.5 * step)
    assert half == pytest.approx(samples(1.5 * step), rel=0.05)
    assert half != pytest.approx(samples(step), rel=0.05)
    assert between.row["instants"] == 3


def test_frames_hold_what_each_way_takes_for_all_chirps() -> None:
    rows = [
        {"method": "tracer", "rtol": 1e-3, "seconds": 0.1, "relative": 1e-3, "adc_seconds": 0.3, "adc_relative": 2e-3},
        {"method": "one sample per pixel", "rays": 4, "view_deg": 60.0, "seconds": 0.01, "relative": 0.5},
    ]
    ours, theirs = pareto.over_frames(subject("plate"), rows, [])
    assert (ours["seconds"], ours["relative"]) == (0.3, 2e-3)
    assert theirs["seconds"] == pytest.approx(0.01 * len(subject("plate").radar.waveform.chirp_times))


def test_before_its_fastest_setting_the_baseline_counts_as_that_good() -> None:
    assert comparison.error_at([(0.1, 3.0), (1.0, 0.3)], 0.001) == pytest.approx(3.0)
    assert comparison.time_at([(0.1, 3.0), (1.0, 0.3)], 0.1) == (1.0, False)
    rows = [{"seconds": seconds, "e": error} for seconds, error in ((1, 3), (2, 4), (3, 1))]
    assert comparison.front(rows, lambda row: row["e"]) == [(1, 3), (3, 1)]


def test_each_way_of_the_baseline_has_a_curve_of_its_own() -> None:
    """Where one is a hair quicker, and both are as good, no step comes of it."""

    def ratio(jittered: float) -> float:
        rows = [{"way": "tracer", "method": "tracer", "rtol": 1e-2, "seconds": 0.01, "relative": 0.01}]
        for method, quicker in (("fixed", 1.0), ("jittered", jittered)):
            for seconds, error in ((0.1, 0.5), (1.0, 0.3 if method == "fixed" else 0.26), (10.0, 0.02)):
                rows.append({"way": "a", "method": method, "seconds": quicker * seconds, "relative": error, "rays": 1})
        return float(comparison.compare_frames(rows, 1e-2)["a"]["equal_error_ratio"])

    assert ratio(0.99) == pytest.approx(ratio(1.01), rel=0.03)


def test_rays_are_compared_at_equal_error() -> None:
    rows = [{"method": "u", "rays": rays, "relative": 1 / rays} for rays in (100, 10_000)]
    rows += [{"method": "a", "rtol": 1e-2, "rays": 50, "relative": error} for error in (1e-3, 1e-5)]
    found = comparison.compare_rays(rows, "a", "u")
    assert [each["share"] for each in found] == pytest.approx([0.05, 0.005])
    assert [each["reached"] for each in found] == [True, False]


def test_claims_say_what_does_not_hold() -> None:
    result = fake()
    result["scenes"][0]["comparison"] = comparison.compare(result["scenes"][0]["rows"], 1e-3)
    found = {each["claim"]: each for each in claims.claims(result)}
    speed = found["moving sphere, samples over 60°: their time to ours at 1 dB and 10°"]
    assert speed["holds"]
    assert speed["note"].startswith("a lower bound")
    assert not found["moving sphere, samples over the subject alone: their time to ours at 1 dB and 10°"]["holds"]
    assert found["skips that change the answer by more than the tolerance"]["note"] == "b"
    assert claims.claims({"default_rtol": 1e-3}) == []


def test_results_are_drawn_and_told(tmp_path: Path) -> None:
    result = json.loads(json.dumps(fake()))
    scene = result["scenes"][0]
    scene["comparison"] = comparison.compare(scene["rows"], 1e-3)
    result["claims"] = claims.claims(result)
    pictures.pareto(scene, tmp_path / "pareto.png")
    pictures.scaling(result["scaling"], tmp_path / "scaling.png")
    assert min(path.stat().st_size for path in tmp_path.iterdir()) > 10_000
    text = tables.markdown(result)
    assert "more than 128 times faster" in text
    assert "| one sample per pixel | 16,384 rays, 60° view |" in text
    assert "Left out, as the rung before took more than 6 s: one sample per pixel (67,108,864 rays)" in text
    assert "Not finished: skips: a" in text
    assert "| b | x | 1 | 3 | 3 | 0.1 | 0 | 0.001 | **no** |" in text


def test_unknown_scenes_and_parts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="scene is 'moon': allowed are sphere, plate"):
        bench.run(tmp_path / "a", ["moon"])
    with pytest.raises(ValueError, match="part is 'all': allowed are scenes"):
        bench.run(tmp_path / "a", parts=["all"])
    assert not (tmp_path / "a").exists()


def test_an_interrupted_run_goes_on_where_it_was(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ran: list[str] = []

    def units(out: Path, wanted: Any, *_: Any) -> Any:
        def work(name: str) -> str:
            ran.append(name)
            if ran.count("b") == 1 and name == "b":
                raise KeyboardInterrupt
            return name

        for name in "abc":
            yield bench.Unit(
                wanted[0], name, lambda name=name: work(name), lambda result, found: result.update({found: len(ran)})
            )

    monkeypatch.setattr(bench, "_units", units)
    quiet = {"progress": lambda line: None, "done": lambda line: None}
    with pytest.raises(KeyboardInterrupt):
        bench.run(tmp_path, parts=["skips"], **quiet)
    kept = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    assert kept["open"] == ["skips: b", "skips: c"]
    assert kept["a"] == 1
    result = bench.run(tmp_path, parts=["skips"], **quiet)
    assert ran == ["a", "b", "b", "c"]
    assert result["a"] == 1
    assert result["open"] == []
    # A run that was finished begins anew, another part is added, other settings begin another file.
    bench.run(tmp_path, parts=["skips"], **quiet)
    assert ran[4:] == ["a", "b", "c"]
    # What fails is told of and left open; the rest is done all the same.
    lines: list[str] = []

    def failing(out: Path, wanted: Any, *_: Any) -> Any:
        yield bench.Unit("skips", "a", lambda: 1 / 0, lambda result, found: None)
        yield bench.Unit("skips", "b", lambda: 2, lambda result, found: result.update(b=found))

    with monkeypatch.context() as patch:
        patch.setattr(bench, "_units", failing)
        result = bench.run(tmp_path, parts=["skips"], progress=lambda line: None, done=lines.append)
    assert result["failed"] == {"skips: a": "ZeroDivisionError: division by zero"}
    assert result["open"] == ["skips: a"]
    assert result["b"] == 2
    assert lines[0] == "skips: a failed: ZeroDivisionError: division by zero"
    both = bench.run(tmp_path, parts=["scaling"], **quiet)["units"]
    assert set(both) == {f"{part}: {name}" for part in ("skips", "scaling") for name in "abc"}
    another = bench.run(tmp_path, parts=["scaling"], seed=1, **quiet)["units"]
    assert set(another) == {f"scaling: {name}" for name in "abc"}
    assert (tmp_path / "bench-before.json").is_file()


def test_the_default_tolerance_is_one() -> None:
    """Of the simulator and of the tracer: the benchmark asks the first."""
    import inspect

    from rfgen_sionna.tracing.tracer import Tracer

    assert inspect.signature(Tracer).parameters["rtol"].default == default_rtol()


def test_whole_runs_are_measured_at_the_tolerance_of_generate() -> None:
    import inspect

    from rfgen_sionna.pipeline import generate
    from tests.benchmarks.pipeline import RTOL

    assert inspect.signature(generate).parameters["rtol"].default == RTOL


def test_the_command_runs_it_from_a_checkout_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    called: dict[str, Any] = {}

    def run(out: Path, scenes: list[str], quick: bool, seed: int, progress: Any, parts: list[str], done: Any) -> Any:
        called.update(out=out, scenes=scenes, quick=quick, seed=seed)
        done("sphere [77]: 3 s")
        return {"seconds": 1.0, "failed": {}, "claims": [{"holds": True}, {"holds": False}]}

    monkeypatch.setattr(bench_command, "load", lambda: SimpleNamespace(run=run))
    options = ["bench", "--scene", "sphere", "--quick", "--seed", "3", "--out", str(tmp_path)]
    answer = CliRunner().invoke(cli.app, options)
    assert answer.exit_code == 0
    assert called == {"out": tmp_path, "scenes": ["sphere"], "quick": True, "seed": 3}
    assert "sphere [77]: 3 s" in answer.stdout
    assert "1 of 2 claims hold" in answer.stdout
    monkeypatch.undo()
    installed = tmp_path / "site-packages" / "rfgen_sionna" / "cli" / "benchmark.py"
    monkeypatch.setattr(bench_command, "__file__", str(installed))
    with pytest.raises(FileNotFoundError, match="not installed from a checkout"):
        bench_command.load()


def test_the_command_names_all_scenes() -> None:
    assert ", ".join(SUBJECTS) == bench_command.SCENES
