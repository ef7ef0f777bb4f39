"""The example of data sets builds, draws, writes a page and learns; a second run goes on with the set."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "dataset.py"


@pytest.mark.slow
def test_a_set_is_built_drawn_and_learnt(tmp_path: Path) -> None:
    command = [sys.executable, EXAMPLE, "--quick", "--folder", tmp_path / "set", "--output", tmp_path / "sheet.png"]
    for made in (3, 0):
        result = subprocess.run(list(map(str, command)), capture_output=True, text=True, cwd=tmp_path)
        assert result.returncode == 0, result.stderr
        assert f"{made} of them made now" in result.stdout
        right, tested = map(int, re.search(r"(\d+) of (\d+) test recordings are right", result.stdout).groups())
        assert 0 <= right <= tested
        assert tested > 0
    with Image.open(tmp_path / "sheet.png") as picture:
        assert picture.width > 1200
    assert "a person" in (tmp_path / "sheet.html").read_text(encoding="utf-8")
