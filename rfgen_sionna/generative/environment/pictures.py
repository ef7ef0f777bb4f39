"""Rendered beside drawn views, as pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.environment.corpus import Corpus
from rfgen_sionna.generative.environment.metrics import Physical
from rfgen_sionna.pir.codec import PirCodec

LEVELS = (-165.0, -115.0)
"""Of the pictures [dB]."""
FARTHEST = 12.0
"""Of the pictures [m]."""


def sheet(
    corpus: Corpus,
    index: NDArray[np.intp],
    images: NDArray[np.floating],
    codec: PirCodec,
    path: Path,
    each: int = 1,
) -> None:
    """Write a picture: for each place, `each` views' energy and range, rendered above, drawn for the same words below.

    Args:
        corpus: rendered views.
        index: (image,) the views that `images` were drawn for.
        images: (image, 3, row, column).
        codec: their convention.
        path: the file.
        each: views of each place.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    chosen = [k for p in np.unique(corpus.places) for k in np.flatnonzero(corpus.places[index] == p)[:each].tolist()]
    real = Physical.of(corpus.images[index[chosen]], codec)
    drawn = Physical.of(images[chosen], codec)
    figure = Figure(figsize=(1.55 * len(chosen), 7.0), layout="compressed")
    axes = figure.subplots(4, len(chosen), squeeze=False)
    rows = (
        ("rendered\nenergy [dB]", real.level, LEVELS, "magma"),
        ("drawn\nenergy [dB]", drawn.level, LEVELS, "magma"),
        ("rendered\nrange [m]", real.range, (0.0, FARTHEST), "viridis"),
        ("drawn\nrange [m]", drawn.range, (0.0, FARTHEST), "viridis"),
    )
    for line, (name, values, (low, high), colours) in zip(axes, rows, strict=True):
        for axis, image in zip(line, values, strict=True):
            shown = axis.imshow(image, vmin=low, vmax=high, cmap=colours)
            axis.set_xticks([])
            axis.set_yticks([])
        line[0].set_ylabel(name, fontsize=9)
        figure.colorbar(shown, ax=line.tolist(), fraction=0.02, pad=0.01)
    for axis, k in zip(axes[0], chosen, strict=True):
        axis.set_title(corpus.names[corpus.places[index[k]]], fontsize=9)
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110)
