"""A radar that is quick to simulate, as a file of one's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.unit.tiny_radar import tiny_radar_text


@pytest.fixture(scope="session")
def tiny_toml(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped radar with 8 loops of 2 Tx, 4 Rx and 64 samples, 20 times a second, as preset "tiny".

    Its range window is that of the mmMesh configuration, 11 m.
    """
    path = tmp_path_factory.mktemp("radars") / "tiny.toml"
    path.write_text(tiny_radar_text(), encoding="utf-8")
    return path
