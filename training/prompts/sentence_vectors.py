"""Vectors of many sentences, kept in a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.prompts.caption_encoder import CaptionEncoder

_AT_ONCE = 512


def vectors_of(texts: Sequence[str], path: Path, progress: Callable[[int], None]) -> NDArray[np.float32]:
    """Vectors (text, width) by the encoder; those of the file are taken from it, others join them.

    Args:
        texts: sentences.
        path: file of known vectors, made if it is missing.
        progress: called with the number of sentences that have a vector.
    """
    known: dict[str, NDArray[np.float32]] = {}
    if path.is_file():
        with np.load(path, allow_pickle=False) as stored:
            known = dict(zip(stored["texts"].tolist(), stored["vectors"], strict=True))
    missing = [text for text in dict.fromkeys(texts) if text not in known]
    encoder = CaptionEncoder()
    for start in range(0, len(missing), _AT_ONCE):
        some = missing[start : start + _AT_ONCE]
        known.update(zip(some, encoder.embed(some), strict=True))
        progress(len(texts) - len(missing) + start + len(some))
    if missing:
        np.savez(path, texts=np.array(list(known)), vectors=np.stack(list(known.values())))
    progress(len(texts))
    return np.stack([known[text] for text in texts])
