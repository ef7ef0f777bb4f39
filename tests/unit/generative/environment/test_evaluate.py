"""The command that examines the shipped model."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer

from rfgen_sionna.generative.environment.evaluate import main
from rfgen_sionna.generative.environment.render import render
from rfgen_sionna.generative.environment.shards import Settings
from rfgen_sionna.generative.environment.shooting import Ranges


@pytest.mark.filterwarnings("ignore:Matrix is singular")  # so few views span nothing
def test_views_of_another_kind_are_examined(tmp_path: Path) -> None:
    """Rolled equirectangular ones are drawn for their own captions; those of training layouts are refused."""
    data, rolled, out = (tmp_path / name for name in ("data", "rolled", "out"))
    render(data, Settings(seed=2, places=("open field",), views=1), 4)  # the first layout is for the test
    kind = Ranges(roll_deg=(20, 40), projections=("equirectangular",))
    render(rolled, Settings(seed=78, places=("open field", "bedroom"), views=1, ranges=kind), 4)
    asked = {"seeds": 0, "view_count": 0, "judge_steps": 2, "steps": 2, "each": 1, "threads": 1}
    main(data, out, other=[rolled], **asked)  # type: ignore[arg-type]
    report = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    figures = report["other views"]["rolled"]
    assert figures["views"] == 2
    assert figures["drawn"]["nothing returns"] < 0.9
    assert 0.0 < figures["drawn"]["range wasserstein, all [m]"] < 100.0
    with pytest.raises(typer.BadParameter, match="shares layouts with the training split"):
        main(data, out, other=[data], **asked)  # type: ignore[arg-type]
