"""The example of the learned model runs and draws its picture."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

pytest.importorskip("anny")
pytest.importorskip("torch")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "generated_motion.py"


@pytest.mark.slow
def test_both_walkers_move_no_faster_than_people_walk(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLE), "--quick", "--output", str(tmp_path / "walk.png")]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    found = dict(re.findall(r"(\w+) +strongest at ([+-][\d.]+) m/s", result.stdout))
    assert set(found) == {"auto", "diffusion"}
    assert all(abs(float(v)) < 2.0 for v in found.values())
    with Image.open(tmp_path / "walk.png") as image:
        assert len(image.convert("RGB").getcolors(2**24)) > 100
