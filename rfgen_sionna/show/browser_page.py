"""Viewer of a run as one static page: it needs a browser and nothing else."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import os
import zlib
from pathlib import Path

import numpy as np

from rfgen_sionna.dataset import Run
from rfgen_sionna.show.displayable import CapturedRun, displayed
from rfgen_sionna.show.page_data import PageData, Progress, page_data
from rfgen_sionna.show.picture_file import picture_file
from rfgen_sionna.show.run_summary import summary
from rfgen_sionna.signal.formats import Capture

_HERE = Path(__file__).parent
"""Folder with the page's HTML, CSS and JavaScript."""
_ALIGNMENT = 8
"""Each array starts at a multiple of so many bytes."""


def html_page(
    run: Run | Capture | str | os.PathLike[str],
    output: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Viewer of a run on one page: scene in three dimensions with mesh and point cloud, PIR, range-Doppler map and
    spectrograms on one time line, labels and report.

    The page holds its data and loads nothing. Of a run of more than 120 frames it has every k-th; meshes are decimated
    and large pictures reduced, so that a page stays below some megabytes.

    Parameters
    ----------
    run
        An open run of one radar, an open capture, or the path of a run.
    output
        File to write: .html.
    overwrite
        Whether an existing page is replaced.
    progress
        Called with the number of finished frames and of all frames; None calls nothing.

    Returns the path of the written file. Errors are those of :func:`~rfgen_sionna.show.sheet`.
    """
    with picture_file(output, overwrite, (".html", ".htm")) as (made, _), displayed(run) as source:
        report = summary(source.capture if isinstance(source, CapturedRun) else source)  # type: ignore[arg-type]
        made.write_text(page_text(page_data(source, report, progress)), encoding="utf-8")
    return Path(output)


def page_text(data: PageData) -> str:
    """HTML of a page. Texts of the run are data: JSON that the page writes as text, under a policy that runs the
    viewer's own script only and loads nothing."""
    places, parts, offset = {}, [], 0
    for name, array in data.arrays.items():
        little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        places[name] = {"dtype": array.dtype.name, "shape": array.shape, "offset": offset}
        parts.append(little.tobytes() + bytes(-little.nbytes % _ALIGNMENT))
        offset += len(parts[-1])
    header = json.dumps(data.header | {"arrays": places}, allow_nan=False).replace("<", "\\u003c")
    script = (_HERE / "viewer.js").read_text(encoding="utf-8")
    filled = {
        "hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        "title": html.escape(data.header["title"]),
        "style": (_HERE / "viewer.css").read_text(encoding="utf-8"),
        "header": header,
        "arrays": base64.b64encode(zlib.compress(b"".join(parts), 9)).decode(),
        "script": script,
    }
    pieces = (_HERE / "viewer.html").read_text(encoding="utf-8").split("{{")
    text = pieces[0]
    for piece in pieces[1:]:  # one pass: a text of the run that looks like a place stays a text
        name, rest = piece.split("}}", 1)
        text += filled[name] + rest
    return text
