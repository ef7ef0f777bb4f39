"""Compression of a recording's words: size, and speed of writing and reading, by each filter of HDF5.

    python -m tests.benchmarks.filters run.h5 [run.h5 …]      results/filters.json

Each run is one of a complex 16-bit ADC that filled its range; its samples are rounded again to the steps of a fixed
range, as recipes set it. Frames are read one by one, as loaders do; times are the least of some turns, of one thread.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import hdf5plugin
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.dataset import open_run

RESULT = Path(__file__).parent / "results" / "filters.json"
FULL_SCALE_DBM = -26.0
"""Input power of a tone that fills the converter [dBm]."""
_BLOSC2 = hdf5plugin.Blosc2
FILTERS: dict[str, Mapping[str, Any]] = {
    "none": {},
    "shuffle, gzip 1": {"compression": "gzip", "compression_opts": 1, "shuffle": True},
    "shuffle, gzip 4": {"compression": "gzip", "compression_opts": 4, "shuffle": True},
    "shuffle, lzf": {"compression": "lzf", "shuffle": True},
    "shuffle, zstd 1": {"shuffle": True, **hdf5plugin.Zstd(clevel=1)},
    "shuffle, zstd 3": {"shuffle": True, **hdf5plugin.Zstd(clevel=3)},
    "bitshuffle, lz4": hdf5plugin.Bitshuffle(cname="lz4"),
    "bitshuffle, lz4, fletcher32": {"fletcher32": True, **hdf5plugin.Bitshuffle(cname="lz4")},
    "bitshuffle, zstd 1": hdf5plugin.Bitshuffle(cname="zstd", clevel=1),
    "bitshuffle, zstd 3": hdf5plugin.Bitshuffle(cname="zstd", clevel=3),
    "blosc2 bitshuffle, lz4": _BLOSC2(cname="lz4", clevel=5, filters=_BLOSC2.BITSHUFFLE),
    "blosc2 bitshuffle, zstd 1": _BLOSC2(cname="zstd", clevel=1, filters=_BLOSC2.BITSHUFFLE),
    "blosc2 bitshuffle, zstd 3": _BLOSC2(cname="zstd", clevel=3, filters=_BLOSC2.BITSHUFFLE),
    "blosc2 shuffle, zstd 3": _BLOSC2(cname="zstd", clevel=3, filters=_BLOSC2.SHUFFLE),
}


def words_of(path: Path) -> NDArray[np.int16]:
    """(frame, chirp, tx, rx, sample, iq) words of a run at steps of the fixed range."""
    with open_run(path) as run:
        samples = run.adc[:]
    step = 10.0 ** ((FULL_SCALE_DBM - 30.0) / 20.0) / 2**15
    levels = np.rint(samples.view(np.float32).reshape(*samples.shape, 2) / step)
    return np.clip(levels, -(2**15), 2**15 - 1).astype(np.int16)


def measured(words: NDArray[np.int16], options: Mapping[str, Any], folder: Path, turns: int = 3) -> dict[str, float]:
    """Size [MB], speed of writing [MB/s of words] and time of reading a frame [ms]."""
    path = folder / "words.h5"
    written, read = [], []
    for _ in range(turns):
        start = time.perf_counter()
        with h5py.File(path, "w") as file:
            file.create_dataset("adc", data=words, chunks=(1, *words.shape[1:]), **options)
        written.append(time.perf_counter() - start)
        with h5py.File(path) as file:
            for frame in range(len(words)):
                start = time.perf_counter()
                _ = file["adc"][frame]
                read.append(time.perf_counter() - start)
    return {
        "MB": round(path.stat().st_size / 1e6, 2),
        "write_MB_s": round(words.nbytes / 1e6 / min(written)),
        "read_frame_ms": round(1e3 * float(np.quantile(read, 0.1)), 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=RESULT)
    given = parser.parse_args()
    result: dict[str, Any] = {"full_scale_dbm": FULL_SCALE_DBM}
    with tempfile.TemporaryDirectory() as folder:
        for path in given.runs:
            words = words_of(path)
            counts = np.unique(words, return_counts=True)[1] / words.size
            entropy = -float((counts * np.log2(counts)).sum()) * words.size / 8e6
            with open_run(path) as run:
                name = f"{run.prompt}; {run.environment or 'free space'}"
            facts = {"raw_MB": round(words.nbytes / 1e6, 2), "entropy_of_words_MB": round(entropy, 2)}
            result[name] = facts | {each: measured(words, FILTERS[each], Path(folder)) for each in FILTERS}
            print(name, json.dumps(result[name], indent=1))
    given.out.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
