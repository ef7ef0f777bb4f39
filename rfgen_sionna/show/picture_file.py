"""Files of pictures, films and pages: checked before long work, and there whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib.figure import Figure

from rfgen_sionna.dataset import check_output
from rfgen_sionna.dataset.whole_files import whole_file

_PICTURES = tuple(sorted(f".{each}" for each in Figure().canvas.get_supported_filetypes()))
"""Endings of the pictures that matplotlib writes."""


@contextmanager
def picture_file(
    output: str | os.PathLike[str], overwrite: bool, endings: Collection[str] = _PICTURES
) -> Iterator[tuple[Path, str]]:
    """Path to write to, whose file becomes `output` when the block ends without an exception, and the format.

    Raises
    ------
    OutputError
        If `output` exists (without `overwrite`), or its folder is missing or not writable.
    ValueError
        If it has none of the `endings`.
    """
    target = check_output(output, overwrite)
    ending = target.suffix.lower()
    if ending not in endings:
        raise ValueError(f"output '{target}' ends in '{target.suffix}'; allowed: {', '.join(endings)}")
    with whole_file(target) as made:
        yield made, ending[1:]
