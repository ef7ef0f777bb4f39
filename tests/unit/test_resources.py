"""Shipped radars and scenes are found by name, in a wheel and in a checkout."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rfgen_sionna import resources


def test_shipped_files_exist():
    for kind in ("radars", "scenes"):
        names = resources.available(kind)
        assert list(names) == sorted(names)
        assert all(resources.resolve(kind, name).is_file() for name in names)
    assert "awr1843" in resources.available("radars")
    assert resources.resolve("scenes", "living_room").name == "scene.xml"


def test_unknown_name_lists_what_there_is():
    with pytest.raises(
        resources.UnknownResourceError, match=r"no radar is called 'awr1834' \(did you mean 'awr1843'\?\)"
    ):
        resources.resolve("radars", "awr1834")


def test_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="allowed are 'radars', 'scenes'"):
        resources.available("motions")


def test_a_wheel_is_searched_before_a_checkout(tmp_path: Path):
    package = tmp_path / "rfgen_sionna"
    (package / "_data" / "radars").mkdir(parents=True)
    (tmp_path / "radars").mkdir()
    (tmp_path / "scenes" / "hall").mkdir(parents=True)
    shutil.copy(resources.__file__, package / "resources.py")
    (package / "_data" / "radars" / "inside.toml").touch()
    (tmp_path / "radars" / "outside.toml").touch()
    (tmp_path / "scenes" / "hall" / "scene.xml").touch()
    code = "import resources as r; print(r.available('radars'), r.available('scenes'))"
    found = subprocess.run([sys.executable, "-c", code], cwd=package, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "('inside',) ('hall',)"
