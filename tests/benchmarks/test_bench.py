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
from rfgen_sionna.scene.rays import RayScene
from tests.benchmarks import bench, pareto, pictures, skips, synthesis, tables
from tests.benchmarks.errors import AdcCheck, Known, floor_db, spurious
from tests.benchmarks.measuring import exponent, timed
from tests.benchmarks.methods import Beams, Method, Samples, Traced
from tests.benchmarks.subjects import SUBJECTS, Subject, sphere
from tests.benchmarks.truth import Quadrature, _share_across, fresnel
from tests.reference.physical_optics import obliquity

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
@pytest.mark.parametrize("skip", skips.SKIPS, ids=lambda skip: skip.name)
def test_without_a_skip_the_answer_is_the_same_to_the_tolerance(skip: skips.Skip) -> None:
    found = skips.row(skip, 1)
    assert found["difference_room"] <= found["allowed"], found
    assert found["difference_actor"] <= found["allowed"], found


# -- the benchmark itself ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("permittivity", [complex(np.inf), 6.57 - 8.91j])
def test_the_quadrature_s_obliquity_is_the_reference_s(permittivity: complex) -> None:
    rng = np.random.default_rng(0)
    normal, towards = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in rng.normal(size=(2, 200, 3)))
    normal = np.where((normal * towards).sum(axis=1, keepdims=True) > 0, -normal, normal)
    field = np.array([0.0, 0.0, 1.0])
    e = field - (towards @ field)[:, None] * towards
    e /= np.linalg.norm(e, axis=1, keepdims=True)
    expected = obliquity(normal, towards, e, -towards, e, permittivity, 1.0)[:, 0]
    cos = -(normal * towards).sum(axis=1)
    r_s, r_p = fresnel(permittivity, 1.0, cos)
    across = _share_across(towards, normal, field)
    np.testing.assert_allclose(cos * (r_s * across - r_p * (1 - across)), expected, atol=1e-12)


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


def test_hidden_points_do_not_count() -> None:
    """Two squares one behind the other: of the farther one, which is twice as wide, a quarter is hidden."""
    square = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1.0]])
    vertices = np.concatenate([0.1 * square + [2, 0, 0], 0.4 * square + [4, 0, 0]])
    faces = np.array([[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]], np.int32)
    rays = RayScene([], [(vertices, faces)], origin=np.zeros(3))
    place = (np.zeros(3), 77e9, complex(np.inf), np.array([0, 0, 1.0]))
    areas = [
        [float(found.area[found.points[:, 0] < 3].sum()), float(found.area[found.points[:, 0] > 3].sum())]
        for found in (Quadrature.of(vertices, faces, *place, each) for each in (None, rays))
    ]
    assert areas[0] == pytest.approx([0.04, 0.64])
    assert areas[1] == pytest.approx([0.04, 0.48], rel=0.01)


def test_exponents_are_found() -> None:
    assert exponent([1, 10, 100, 1000], [1.0, 1.1, 10.0, 1000.0]) == pytest.approx(2.0)


def fake() -> dict[str, Any]:
    def row(method: str, seconds: float, relative: float, **more: Any) -> dict[str, Any]:
        return {
            "method": method, "seconds": seconds, "first_seconds": 1.0, "peak_mb": None, "relative": relative,
            "level_db": 8 * relative, "phase_deg": 50 * relative, **more,
        }  # fmt: skip

    rows = [row("tracer", 0.02, 1e-3, rtol=1e-3), row("tracer", 0.01, 2e-2, rtol=1e-2)]
    for pixels, seconds, relative in ((128, 0.005, 3.0), (1024, 0.1, 0.4), (4096, 2.0, 0.1)):
        rows.append(row("one sample per pixel", seconds, relative, rays=pixels**2, view_deg=60.0))
        rows.append(row("one sample per pixel", seconds, relative / 3, rays=pixels**2, view_deg=20.0))
    return {
        "command": "rfgen bench", "machine": {"processor": "p", "cores": 2, "load": None, "variant": "v"},
        "versions": {"python": "3"},
        "scenes": [{"scene": "x", "band_ghz": 77, "title": "t", "truth": "u", "truth_own_error": 1e-4, "rows": rows}],
        "scaling": {"rays": {"of": "o", "sizes": [1, 10], "seconds": [1.0, 10.0], "exponent": 1.0}},
    }  # fmt: skip


def test_methods_are_compared_at_equal_time_and_at_equal_error() -> None:
    found = pareto.compare(fake()["scenes"][0]["rows"])
    assert found["error_ratio_at_equal_time"] == pytest.approx(3000)  # of the 128^2 rays that the time allows
    assert found["time_ratio_at_equal_error"] == pytest.approx(200)
    assert found["baseline_reaches_it"]


def test_results_are_drawn_and_told(tmp_path: Path) -> None:
    result = json.loads(json.dumps(fake()))
    scene = result["scenes"][0]
    scene["comparison"] = pareto.compare(scene["rows"])
    pictures.pareto(scene, tmp_path / "pareto.png")
    pictures.scaling(result["scaling"], tmp_path / "scaling.png")
    assert min(path.stat().st_size for path in tmp_path.iterdir()) > 10_000
    text = tables.markdown(result)
    assert "3e+03 times smaller" in text
    assert "200 times faster at 1 dB and 10°" in text
    assert "| one sample per pixel | 16,384 rays, 60° view |" in text


def test_unknown_scenes_and_parts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="scene is 'moon': allowed are sphere, plate"):
        bench.run(tmp_path / "a", ["moon"])
    with pytest.raises(ValueError, match="part is 'all': allowed are scenes"):
        bench.run(tmp_path / "a", parts=["all"])
    assert not (tmp_path / "a").exists()


def test_the_command_runs_it_from_a_checkout_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from typer.testing import CliRunner

    called: dict[str, Any] = {}

    def run(out: Path, scenes: list[str], quick: bool, seed: int, progress: Any, parts: list[str]) -> dict[str, float]:
        called.update(out=out, scenes=scenes, quick=quick, seed=seed)
        return {"seconds": 1.0}

    monkeypatch.setattr(cli, "_benchmark", lambda: SimpleNamespace(run=run))
    options = ["bench", "--scene", "sphere", "--quick", "--seed", "3", "--out", str(tmp_path)]
    assert CliRunner().invoke(cli.app, options).exit_code == 0
    assert called == {"out": tmp_path, "scenes": ["sphere"], "quick": True, "seed": 3}
    monkeypatch.undo()
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "site-packages" / "rfgen_sionna" / "cli.py"))
    with pytest.raises(FileNotFoundError, match="not installed from a checkout"):
        cli._benchmark()
