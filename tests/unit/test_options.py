"""Options of a generated run that are checked before anything is built."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.options import check_options
from rfgen_sionna.pipeline import generate
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.config import RadarConfigError


def test_generation_takes_a_configuration_and_its_board(tmp_path: Path) -> None:
    path = tmp_path / "mine.cfg"
    path.write_text(Radar.load("iwr6843isk").to_cfg(), encoding="utf-8")
    defaults = signature(generate).parameters
    options: dict[str, Any] = {name: defaults[name].default for name in signature(check_options).parameters}
    options |= {"radar": str(path), "duration": 1.0}
    with pytest.raises(RadarConfigError, match=r"boards at .*: iwr6843aop, iwr6843isk, iwr6843isk_ods"):
        check_options(**options)
    radar = check_options(**options | {"board": "IWR6843ISK"})[0]
    assert (radar.name, radar.preset, radar.position) == ("iwr6843isk", "frame", (0.0, 0.0, 1.0))
    with pytest.raises(ValueError, match="board is 'awr1843' but a Radar is given"):
        check_options(**options | {"radar": radar, "board": "awr1843"})
