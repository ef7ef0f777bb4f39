"""A radar that is quick to simulate."""

from __future__ import annotations

from pathlib import Path

import pytest

from rfgen_sionna.radar import Radar


@pytest.fixture(scope="session")
def tiny_radar(tiny_toml: Path) -> Radar:
    return Radar.load(tiny_toml)


@pytest.fixture(params=["both scenes", "a scene each"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that ask static and moving scenes, as on the CPU, and such that ask but one, as OptiX needs them."""
    if request.param == "a scene each":
        monkeypatch.setattr("rfgen_sionna.scene.ray_layer.one_scene_per_kernel", lambda: True)
