"""Figures of the page on the evaluation are those of the results."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from experiments.tables import PAGE, rendered


def test_the_page_has_the_figures_of_the_results() -> None:
    text = PAGE.read_text()
    assert rendered(text) == text, "run python -m experiments.tables"
    assert len(re.findall(r"<!-- \S+\.json: ", text)) == len(re.findall("<!--", text)), "a comment names no source"


def test_figures_are_found_scaled_and_formatted(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(
        json.dumps({"forest": {"to real": 0.7149}, "errors": [0.0587, 1], "machine": "x", "none": None})
    )
    text = (
        "| <!-- a.json: forest > to real: .2f --> | 3.1<!-- a.json: errors > 0: .1f*100 --> cm | "
        "(<!-- a.json: machine: s -->) <!-- a.json: none: .2f -->"
    )
    once = rendered(text, tmp_path)
    assert re.sub("<!--.*?-->", "", once) == "| 0.71 | 5.9 cm | (x) –"
    assert rendered(once, tmp_path) == once


@pytest.mark.parametrize(
    ("comment", "message"),
    [
        ("<!-- b.json: x: .2f -->", "there is no file"),
        ("<!-- a.json: y: .2f -->", "there is no 'y', but x"),
        ("<!-- a.json: x > 1: .2f -->", "there is no '1', but a list"),
        ("<!-- a.json: x > 0: two -->", "no format"),
    ],
)
def test_figures_without_a_source_are_errors(tmp_path: Path, comment: str, message: str) -> None:
    (tmp_path / "a.json").write_text('{"x": [1.5]}')
    with pytest.raises(ValueError, match=message):
        rendered(comment, tmp_path)
