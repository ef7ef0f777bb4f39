"""The training loop of the documentation, run as it is written."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.unit.dataset.small_sets import make_set

ROOT = Path(__file__).parents[2]


def loops():
    """Training loops in the documentation, by their file."""
    for page in (ROOT / "README.md", ROOT / "docs" / "datasets.md"):
        for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            if "optimizer" in block:
                yield pytest.param(block, id=page.name)


def learned(block, folder):
    """Right answers and all answers of the loop, run in the folder that has the set."""
    done = subprocess.run([sys.executable, "-c", block], cwd=folder, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    right, total = map(int, re.search(r"(\d+) of (\d+)", done.stdout).groups())
    return right, total


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With a small set in it, as the documentation names it."""
    folder = tmp_path_factory.mktemp("documentation")
    make_set(folder / "tiny", count=24)
    return folder


@pytest.mark.parametrize("block", list(loops()))
def test_the_loop_runs_and_learns(block, folder):
    right, total = learned(block, folder)
    assert total == 8
    assert right >= 6  # chance is 4


@pytest.mark.slow
@pytest.mark.parametrize("block", list(loops()))
def test_the_loop_learns_the_actions_of_the_example(block, tmp_path):
    from rfgen_sionna.recipes import Recipe
    from rfgen_sionna.recipes.building import build_dataset

    build_dataset(Recipe.load(ROOT / "examples" / "recipes" / "tiny.toml"), tmp_path / "tiny")
    right, total = learned(block, tmp_path)
    assert total == 6
    assert right >= 4  # chance is 2
