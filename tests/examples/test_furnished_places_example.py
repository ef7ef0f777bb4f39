"""The example of the furnished places runs and draws its picture."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from PIL import Image

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "furnished_places.py"


def test_two_places_are_drawn(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLE), "--quick", "--output", str(tmp_path / "places.png")]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "living room" in result.stdout
    assert "1 bed" in result.stdout
    with Image.open(tmp_path / "places.png") as image:
        assert len(image.convert("RGB").getcolors(2**24)) > 500
