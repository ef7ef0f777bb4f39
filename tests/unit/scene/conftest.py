"""A radar that is quick to simulate."""

from __future__ import annotations

from pathlib import Path

import pytest

from rfgen_sionna.radar import Radar


@pytest.fixture(scope="session")
def tiny_radar(tiny_toml: Path) -> Radar:
    return Radar.load(tiny_toml)
