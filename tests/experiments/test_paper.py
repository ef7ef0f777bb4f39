"""The programs of the paper's tables: their arguments, their parts, and each in its quick form."""

from __future__ import annotations

import json
import math
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.paper.fidelity_scenes import IMPAIRMENTS, RADARS, measured, other_body, real_results, recipe
from experiments.paper.reports import ROOT, experiment_parser, run_experiment
from experiments.paper.sets import shared
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.receiver.receiver_record import chosen_receiver

PROGRAMS = ("cloud_fidelity", "noise", "overhead", "prompts", "signal_fidelity")


def result_of(name: str, folder: Path) -> dict[str, Any]:
    """Result of a program's quick form."""
    import_module(f"experiments.paper.{name}").main(["--quick", "--output", str(folder)])
    report: dict[str, Any] = json.loads((folder / f"{name}.json").read_text())
    assert report["form"] == "quick"
    assert report["seconds"] > 0
    assert report["machine"]["cores"]
    result: dict[str, Any] = report["result"]
    return result


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_and_wrong_arguments_end_early(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    main = import_module(f"experiments.paper.{name}").main
    (tmp_path / "file").write_text("")
    for words, message in (
        (["--help"], "--quick"),
        (["--quick"], "--output"),
        (["--output", str(tmp_path), "--seed", "-1"], "'-1' is no seed"),
        (["--output", str(tmp_path), "--fast"], "--fast"),
        (["--output", str(tmp_path / "file")], "a file: give a folder"),
    ):
        with pytest.raises(SystemExit):
            main(words)
        written = capsys.readouterr()
        assert message in written.out + written.err


def test_a_report_is_whole_json(tmp_path: Path) -> None:
    parser = experiment_parser("Nothing.")
    found: dict[str, Any] = {"mean": np.float64(0.5), "none": math.nan, "list": (1, np.arange(2)), "3": True}
    file = run_experiment(
        "nothing", parser, lambda arguments: found, ["--output", str(tmp_path / "new"), "--seed", "4"]
    )
    report = json.loads(file.read_text())
    assert report["result"] == {"mean": 0.5, "none": None, "list": [1, [0, 1]], "3": True}
    assert (report["form"], report["seed"]) == ("full", 4)
    assert report["command"].startswith("python -m experiments.paper.nothing --output")


@pytest.mark.parametrize("quick", [True, False])
def test_a_measured_scene_has_other_noise_and_nothing_else_in_another_way(quick: bool) -> None:
    for spec in recipe(quick, 0):
        own = measured(spec)
        assert own.rtol < spec.rtol
        assert set(shared([spec], [own])) == {"bodies", "places", "motions", "clips"}
        assert set(shared([spec], [other_body(spec)])) == {"places", "motions", "noise", "clips"}


@pytest.mark.parametrize(("radar", "preset"), [each[1:] for each in RADARS])
def test_boards_can_have_the_impairments(radar: str, preset: str) -> None:
    assert chosen_receiver(IMPAIRMENTS, Radar.load(radar, preset=preset), True).thermal_noise


def test_real_results_are_files() -> None:
    assert all((ROOT / file).is_file() for files in real_results().values() for file in files)


@pytest.mark.slow
def test_images_of_one_scene_are_more_alike_than_those_of_others(tmp_path: Path) -> None:
    result = result_of("signal_fidelity", tmp_path)
    for images in result["radars"].values():
        for name, metrics in images.items():
            assert metrics["ssim_db"]["margin"] > 0, name
            assert metrics["psnr_db"]["margin"] > 0, name
    clouds = result_of("cloud_fidelity", tmp_path)["radars"]
    assert all(chain["metrics"]["chamfer"]["margin"] > 0 for chain in clouds.values())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["noise", "prompts"])
def test_networks_are_trained_and_tested(name: str, tmp_path: Path) -> None:
    result = result_of(name, tmp_path)
    assert len(result["classes"]) == 5
    values = [way.get("unseen", way)["mean"] for way in result["accuracy"].values()]
    assert len(values) == 4
    assert all(0.0 <= value <= 1.0 for value in values)


@pytest.mark.slow
def test_each_stage_has_its_time(tmp_path: Path) -> None:
    result = result_of("overhead", tmp_path)
    assert len(result["stages"]) == 2
    for row in result["stages"].values():
        assert all(seconds > 0 for seconds in row["seconds"].values())
    assert result["benchmark"]["person"]["mesh_to_samples_seconds"] > 0
