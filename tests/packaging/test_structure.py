"""One name for one thing, in the words of the field; small modules; pages whose references exist."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import rfgen_sionna

PACKAGE = Path(rfgen_sionna.__file__).parent
ROOT = Path(__file__).resolve().parents[2]
MAX_LINES = 400
BUDGET = {".": (85_550, 542), "tracing": (15_306, 99)}
"""Most lines and modules of the package and of its tracer. They only fall."""
HOME_MADE = re.compile(
    r"aslant|bend|bends|bent|bow|bowed|bricks|clear_arms|doubt|doubts|echoes|encounters|enclosure|expectation|"
    r"fading|faint|fineness|flashes|folded|foreign|further|glance|glances|glanced|glint|glints|hider|hiders|"
    r"hands_up|judge|kept|landed|landing|leader|lifts|lit|looked|looking|loud|loudness|lots|outline|outlines|"
    r"over_floor|own_places|passing|polish|rim|rims|rises|roles|seams|shoot|shower|shown|sight|skin_of|stretch|"
    r"strips|taps|told|tubes|usual|veil|veils|veiled|wishes"
)
"""Words of earlier versions that no textbook of radar, electromagnetics, ray tracing or graphics has."""


@cache
def modules() -> dict[Path, ast.Module]:
    """Parsed modules of the package, by their paths below it."""
    return {path.relative_to(PACKAGE): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


def home_made(name: str) -> bool:
    """Whether a name in snake case or camel case, or a word of it, is a home-made one."""
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    return any(map(HOME_MADE.fullmatch, (snake.strip("_"), *snake.split("_"))))


def defined(tree: ast.Module) -> Iterator[str]:
    """Names of classes and of public functions and methods."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) or (isinstance(node, ast.FunctionDef) and not node.name.startswith("_")):
            yield node.name


def test_a_class_name_stands_in_one_file() -> None:
    homes = defaultdict(list)
    for path, tree in modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(str(path))
    assert not {name: where for name, where in homes.items() if len(where) > 1}


def test_a_module_name_stands_in_one_place() -> None:
    homes = defaultdict(list)
    for path in modules():
        if path.stem != "__init__":
            homes[path.stem].append(str(path))
    assert not {name: where for name, where in homes.items() if len(where) > 1}


def test_names_are_words_of_the_field() -> None:
    found = [str(path) for path in modules() if any(home_made(part) for part in path.with_suffix("").parts)]
    found += [f"{path}: {name}" for path, tree in modules().items() for name in defined(tree) if home_made(name)]
    assert not found


def test_no_module_is_long() -> None:
    lines = {str(path): len((PACKAGE / path).read_text().splitlines()) for path in modules()}
    assert not {path: count for path, count in lines.items() if count > MAX_LINES}


@pytest.mark.parametrize("part", BUDGET)
def test_the_package_only_gets_smaller(part: str) -> None:
    files = list((PACKAGE / part).rglob("*.py"))
    lines = sum(len(path.read_text().splitlines()) for path in files)
    assert lines <= BUDGET[part][0]
    assert len(files) <= BUDGET[part][1]


def test_the_readme_is_short() -> None:
    lines = (ROOT / "README.md").read_text().splitlines()
    assert len(lines) <= 150
    assert max(map(len, lines)) <= 120


PAGES = ["README.md", *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs").glob("*.md")))]


@pytest.mark.parametrize("page", PAGES)
def test_paths_on_a_page_exist(page: str) -> None:
    text = (ROOT / page).read_text()
    paths = re.findall(r"`((?:rfgen_sionna|tests|examples|training|radars|scenes|docs)/[\w/.]*)`", text)
    paths += re.findall(r"`(?:\w+/)*((?:rfgen_sionna|tests)/[\w/]+\.py)::", text)
    links = [link.split("#")[0] for link in re.findall(r"\]\((?!https?:)([^)]+)\)", text)]
    missing = [path for path in paths if not (ROOT / path).exists()]
    missing += [link for link in links if link and not ((ROOT / page).parent / link).exists()]
    assert not missing


def test_tests_named_on_the_page_of_errors_exist() -> None:
    missing = []
    for path, name in re.findall(
        r"`((?:tests/[\w/]+/)?test_\w+\.py)(?:::(\w+))?`", (ROOT / "docs/accuracy.md").read_text()
    ):
        file = ROOT / path if "/" in path else ROOT / "tests/physics" / path
        if not file.is_file() or (name and f"def {name}(" not in file.read_text()):
            missing.append(f"{path}::{name}")
    assert not missing
