"""Surroundings come from files, from a seed or from a model, and what has no effect is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna.generative.prompts import PromptError, parse_environment
from rfgen_sionna.generative.setting import IMAGE_PIXELS, check_kind, set_up
from rfgen_sionna.scene.furnished import FurnishedScene


def kind(environment: str | None, surroundings: str = "auto", negative: str = "", refine: bool | None = None) -> str:
    return check_kind(surroundings, parse_environment(environment), negative=negative, refine=refine)


def test_a_scene_of_a_file_comes_first() -> None:
    assert kind("a living room") == "scene"
    assert kind("Munich") == "scene"
    assert kind("an office") == "furnished"
    assert kind("a living room", "furnished") == "furnished"
    assert kind("a living room", "diffusion") == "diffusion"
    assert kind(None) == kind("free space") == "none"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("a living room", "painted"),
            "surroundings is 'painted'; allowed are 'auto', 'scene', 'furnished', 'diffusion'",
        ),
        ((None, "furnished"), "no environment is named"),
        (("an office", "scene"), "'an office' is no scene of a file"),
        (("Munich", "furnished"), "'Munich' is a scene of a file alone"),
        (("Munich", "diffusion"), "'Munich' is a scene of a file alone"),
        (("an office", "furnished", "desk"), "negative_environment is 'desk': only imagined surroundings"),
        (("a living room", "auto", "", True), "refine is True: only imagined surroundings"),
    ],
)
def test_what_has_no_effect_is_refused(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises((ValueError, PromptError), match=words):
        kind(*arguments)


def test_a_seed_furnishes(tiny_toml: Path) -> None:
    radar = rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    office, again, other = (set_up(parse_environment("an office"), "furnished", radar, seed=s) for s in (3, 3, 4))
    assert isinstance(office.scene, FurnishedScene)
    assert office.name == "furnished office"
    assert "pieces" in office.decisions[0].value
    assert office.decisions[0].value == again.decisions[0].value != other.decisions[0].value


def test_a_run_in_a_furnished_place(tiny_toml: Path, tmp_path: Path) -> None:
    pytest.importorskip("anny", reason="people need the body model")
    quick: dict[str, Any] = {"radar": tiny_toml, "duration": 0.05, "pir_resolution": (12, 16), "rtol": 0.03}
    with rfgen.generate("a person stands in a corridor", seed=2, output=tmp_path / "c.h5", **quick) as run:
        assert run.environment == "furnished corridor"
        assert run.seeds["surroundings"] == 2
        assert "corridor of" in run.report
        assert np.isfinite(run.pir(0).time_of_arrival).mean() > 0.9


def test_a_run_in_an_imagined_place(tiny_toml: Path, tmp_path: Path) -> None:
    """Object, environment and path diffusion at work; images have the model's own pixels."""
    pytest.importorskip("anny", reason="people need the body model")
    pytest.importorskip("diffusers", reason="the models need it")
    asked: dict[str, Any] = {"environment": "a bedroom", "surroundings": "diffusion", "radar": tiny_toml}
    quick: dict[str, Any] = {"duration": 0.05, "rtol": 0.03, "seed": 2, **asked}
    with rfgen.generate("a person stands, at 2 m", output=tmp_path / "refined.h5", **quick) as run:
        assert run.environment == "imagined bedroom"
        assert "path diffusion" in run.report
        refined = run.pir(0)
    with rfgen.generate("a person stands, at 2 m", output=tmp_path / "plain.h5", refine=False, **quick) as run:
        assert "path diffusion" not in run.report
        plain = run.pir(0)
    assert plain.energy.shape == refined.energy.shape == IMAGE_PIXELS
    assert plain.fov_deg == (90.0, 90.0)
    both = (plain.energy > 0) & (refined.energy > 0)
    change = 10 * np.log10(refined.energy[both] / plain.energy[both])
    assert 0.01 < np.sqrt(np.mean(change**2)) < 15.0
    np.testing.assert_allclose(refined.time_of_arrival[both], plain.time_of_arrival[both], rtol=1e-3)
    with pytest.raises(ValueError, match="imagined surroundings come in"):
        rfgen.generate("a person stands", output=tmp_path / "no.h5", pir_resolution=(32, 32), **quick)
