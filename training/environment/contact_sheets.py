"""Rendered beside drawn and refined views, as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.codec import PirCodec
from training.environment.image_metrics import Physical
from training.environment.path_evaluation import pir_of
from training.environment.place_captions import named
from training.environment.view_corpus import ViewCorpus

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion

LEVELS = (-165.0, -115.0)
"""Of the pictures [dB]."""
FARTHEST = 12.0
"""Of the pictures [m]."""


def sheet(
    corpus: ViewCorpus,
    index: NDArray[np.intp],
    images: NDArray[np.floating],
    codec: PirCodec,
    path: Path,
    each: int = 1,
) -> None:
    """Write a picture: for each place, `each` views' energy and range, rendered above, drawn for the same words below;
    those of which the render shows most kinds of furniture.

    Args:
        corpus: rendered views.
        index: (image,) the views that `images` were drawn for.
        images: (image, 3, row, column).
        codec: their convention.
        path: the file.
        each: views of each place.
    """
    kinds = np.array([len(named(corpus.objects[i])) for i in index.tolist()])
    most = np.argsort(-kinds, kind="stable")
    chosen = [k for p in np.unique(corpus.places) for k in most[corpus.places[index[most]] == p][:each].tolist()]
    real = Physical.of(corpus.images[index[chosen]], codec)
    drawn = Physical.of(images[chosen], codec)
    rows: list[_Row] = [
        ("rendered\nenergy [dB]", real.level, LEVELS, "magma"),
        ("drawn\nenergy [dB]", drawn.level, LEVELS, "magma"),
        ("rendered\nrange [m]", real.range, (0.0, FARTHEST), "viridis"),
        ("drawn\nrange [m]", drawn.range, (0.0, FARTHEST), "viridis"),
    ]
    _draw(rows, [corpus.names[corpus.places[index[k]]] for k in chosen], path)


def completed_sheet(pairs: ViewCorpus, refiner: PathDiffusion, path: Path, *, strength: float, seed: int = 0) -> None:
    """Write a picture: for each place, the energy of one incomplete view, refined, and complete.

    Args:
        pairs: incomplete and complete views; the first of each place is shown.
        refiner: what completes them.
        path: the file.
        strength, seed: of the refinement.
    """
    codec = refiner.backend.model.codec
    chosen = [int(np.flatnonzero(pairs.places == p)[0]) for p in np.unique(pairs.places)]
    given = [pir_of(pairs.lacking[k], pairs.views[k], codec) for k in chosen]
    refined = [
        refiner.refine(image, pairs.captions[k], strength=strength, seed=seed)
        for image, k in zip(given, chosen, strict=True)
    ]
    rows: list[_Row] = [
        (f"{name}\nenergy [dB]", Physical.of(images, codec).level, LEVELS, "magma")
        for name, images in (
            ("incomplete", pairs.lacking[chosen]),
            ("refined", np.stack([codec.encode(image, clip=True) for image in refined])),
            ("complete", pairs.images[chosen]),
        )
    ]
    _draw(rows, [pairs.names[pairs.places[k]] for k in chosen], path)


_Row = tuple[str, FloatArray, tuple[float, float], str]
"""Label, (image, row, column) values, their limits, colours."""


def _draw(rows: Sequence[_Row], titles: Sequence[str], path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1.55 * len(titles), 1.75 * len(rows)), layout="compressed")
    axes = figure.subplots(len(rows), len(titles), squeeze=False)
    for line, (name, values, (low, high), colours) in zip(axes, rows, strict=True):
        for axis, image in zip(line, values, strict=True):
            shown = axis.imshow(image, vmin=low, vmax=high, cmap=colours)
            axis.set_xticks([])
            axis.set_yticks([])
        line[0].set_ylabel(name, fontsize=9)
        figure.colorbar(shown, ax=line.tolist(), fraction=0.02, pad=0.01)
    for axis, title in zip(axes[0], titles, strict=True):
        axis.set_title(title, fontsize=9)
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110)
