"""Each example runs, says what it found, and draws its picture."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def run(name: str, picture: Path, *options: str) -> str:
    command = [sys.executable, str(EXAMPLES / name), "--output", str(picture), *options]
    result = subprocess.run(command, capture_output=True, text=True, cwd=picture.parent)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize("options", [["--quick"], pytest.param([], marks=pytest.mark.slow)])
def test_awr1843_finds_the_ball_where_it_is(tmp_path: Path, options: list[str]) -> None:
    out = run("awr1843.py", tmp_path / "map.png", *options)
    # The centre lies at (1.5, 0.5) m from the radar; what it returns comes from its front, 5 cm nearer. It moves
    # along x, so that its radial velocity is 0.5 m/s times the cosine of its azimuth.
    true_range, true_velocity = map(float, re.search(r"range ([\d.]+) m, velocity ([+-][\d.]+) m/s", out).groups())
    distance = np.hypot(1.5, 0.5)
    assert true_range == pytest.approx(distance - 0.05, abs=0.01)
    assert true_velocity == pytest.approx(0.5 * 1.5 / distance, abs=0.01)
    x, y, z, velocity = map(float, re.search(r"found at \((.+), (.+), (.+)\) m, ([+-][\d.]+) m/s", out).groups())
    assert (x, y, z) == pytest.approx((1.5, 0.5, 1.0), abs=0.08)
    assert velocity == pytest.approx(true_velocity, abs=0.07)  # one Doppler cell
    # What it can and cannot see.
    assert re.findall(r"(\d+) deg apart: (\d)", out) == [("24", "2"), ("8", "1")]
    folded, unfolded = map(float, re.search(r"at \+6 m/s +found (\S+) .* ambiguities=1 (\S+) m/s", out).groups())
    assert (folded, unfolded) == pytest.approx((6.0 - 8.77, 6.0), abs=0.03)
    with Image.open(tmp_path / "map.png") as picture:
        assert picture.width > 500
        assert len(picture.convert("RGB").getcolors(2**24)) > 100


def drawn(picture: Path) -> bool:
    with Image.open(picture) as image:
        return image.width > 1200 and len(image.convert("RGB").getcolors(2**24)) > 100


@pytest.mark.slow
@pytest.mark.parametrize("options", [["--quick"], []])
def test_the_cascade_tells_apart_what_the_awr1843_does_not(tmp_path: Path, options: list[str]) -> None:
    out = run("mmwcas.py", tmp_path / "maps.png", *options)
    found = {
        name: [float(a) for a in angles.split(",")] for name, angles in re.findall(r"(\w+) +\d+ at .*azimuth (.*)", out)
    }
    assert found["mmwcas"] == pytest.approx([-1.25, 1.25], abs=0.35)
    assert found["awr1843"] == pytest.approx([0.0], abs=1.0)
    assert drawn(tmp_path / "maps.png")


@pytest.mark.slow
@pytest.mark.parametrize("options", [["--quick"], []])
def test_position2go_finds_distance_speed_and_side(tmp_path: Path, options: list[str]) -> None:
    out = run("position2go.py", tmp_path / "panels.png", *options)
    range_, azimuth, velocity = map(float, re.search(r"found at ([\d.]+) m, (.+) deg, (.+) m/s", out).groups())
    assert range_ == pytest.approx(4.0, abs=0.075)
    assert azimuth == pytest.approx(20.0, abs=1.0)
    assert velocity == pytest.approx(-2.0, abs=0.08)
    wrong = dict(re.findall(r"(position2go\w*): .* (\d+) of \d+ wrong", out))
    assert int(wrong["position2go"]) == 0
    assert int(wrong["position2go_v11"]) >= 4  # beyond 53 degrees on either side
    assert drawn(tmp_path / "panels.png")


@pytest.mark.slow
def test_bgt60tr13c_follows_a_chest(tmp_path: Path) -> None:
    out = run("bgt60tr13c.py", tmp_path / "breath.png", "--quick", "--rate", "0.3", "--depth", "3")
    range_, rate = map(float, re.search(r"simulated: ([\d.]+) m, ([\d.]+) breaths a second", out).groups())
    assert range_ == pytest.approx(0.33, abs=0.01)
    assert rate == pytest.approx(0.3, abs=0.01)
    with Image.open(tmp_path / "breath.png") as image:
        assert len(image.convert("RGB").getcolors(2**24)) > 100
