"""Figures of `docs/evaluation.md`, from the results of the experiments.

    python -m experiments.tables            # writes the figures into the page
    python -m experiments.tables --check    # lists those that differ, with exit status 1

A comment after a figure names its source: the file below `experiments`, the keys in it, the format, and a factor:

    0.71<!-- radhar/results/classify.json: random forest > synthetic to real: .2f -->
    5.9<!-- mars/results/pose.json: error_m: .1f*100 -->

A key is that of a dictionary or the index of a list; a figure that a result lacks is an error.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

EXPERIMENTS = Path(__file__).parent
PAGE = EXPERIMENTS.parent / "docs/evaluation.md"
_FIGURE = re.compile(r"(?P<text>[^\s|(]*)<!-- (?P<file>\S+\.json): (?P<keys>[^<]+): (?P<form>\S+) -->")
_FORM = re.compile(r"(?P<spec>[-+,.\w%]*?[dfg%s])(?:\*(?P<factor>[\d.]+))?")


def rendered(text: str, folder: Path = EXPERIMENTS) -> str:
    """A page with every figure as its source has it.

    Raises
    ------
    ValueError
        For a source without the file or the key, or a format that is none.
    """
    return _FIGURE.sub(lambda match: figure(match, folder) + match[0][len(match["text"]) :], text)


def figure(match: re.Match[str], folder: Path) -> str:
    """Figure of one comment, as text."""
    source, form = folder / match["file"], _FORM.fullmatch(match["form"])
    if not source.is_file() or form is None:
        raise ValueError(f"{match[0]}: there is no file {source}" if form else f"{match[0]}: no format and factor")
    value: Any = json.loads(source.read_text())
    for key in match["keys"].split(" > "):
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (KeyError, IndexError, TypeError, ValueError):
            there = ", ".join(value) if isinstance(value, dict) else f"a {type(value).__name__} of {value!r:.60}"
            raise ValueError(f"{match[0]}: there is no {key!r}, but {there}") from None
    if value is None:
        return "–"
    factor = float(form["factor"]) if form["factor"] else 1
    return format(value * factor if form["factor"] else value, form["spec"] if form["spec"] != "s" else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    before = PAGE.read_text()
    after = rendered(before)
    if parser.parse_args().check:
        differing = [new for old, new in zip(before.splitlines(), after.splitlines(), strict=True) if old != new]
        sys.exit("\n".join(["lines that are not up to date:", *differing]) if differing else 0)
    PAGE.write_text(after)


if __name__ == "__main__":
    main()
