"""Speed and memory of the loaders of a data set, beside what the disk gives."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from torch.utils.data import DataLoader, RandomSampler

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.set_index import write_index
from rfgen_sionna.dataset.torch import RadarDataset, StreamingRadarDataset

_BLOCK = 8 << 20


def enlarge(folder: Path, target: Path, size: float) -> Path:
    """A set of about `size` bytes in `target`, of copies of the shards of a set with other numbers of recordings."""
    shards = sorted(folder.glob("shard-*.h5"))
    own = sum(path.stat().st_size for path in shards)
    target.mkdir()
    shutil.copy(folder / "recipe.toml", target)
    count = len(open_dataset(folder))
    for copy in range(max(1, round(size / own))):
        for number, shard in enumerate(shards):
            path = target / f"shard-{copy * len(shards) + number:05d}.h5"
            shutil.copyfile(shard, path)
            if copy:
                with h5py.File(path, "r+") as file:
                    group = file["recordings"]
                    for name in sorted(group, reverse=True):
                        group.move(name, f"{int(name) + copy * count:06d}")
    write_sums(target, write_index(target).shards)
    return target


def forget(folder: Path) -> None:
    """Drop the files of a folder from the page cache, so that they are read from the disk."""
    for path in folder.glob("*.h5"):
        handle = os.open(path, os.O_RDONLY)
        os.fsync(handle)
        os.posix_fadvise(handle, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(handle)


def disk_rate(folder: Path) -> float:
    """Bytes a second of plain reads of the shards."""
    forget(folder)
    begin, total = time.perf_counter(), 0
    for path in sorted(folder.glob("*.h5")):
        with path.open("rb", buffering=0) as file:
            while block := file.read(_BLOCK):
                total += len(block)
    return total / (time.perf_counter() - begin)


def memory(processes: Sequence[int] = ()) -> float:
    """Resident memory of this process and of others [MB], without what they share with files."""
    total = 0
    for process in (os.getpid(), *processes):
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
        total += sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))
    return total / 1e3


def core_seconds(process: int) -> float:
    """Time on a core that a process has used [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def random_access(folder: Path, workers: int = 2, maps: int = 2000) -> dict[str, Any]:
    """Range-Doppler maps a second of single frames drawn at random, the time of a core that each takes in a worker, and
    the memory at quarters of the epoch."""
    period = open_dataset(folder)[0].radar.waveform.frame_period
    data = RadarDataset(folder, None, "range_doppler", "action", window_s=period)
    sampler = RandomSampler(data, num_samples=maps, generator=torch.Generator().manual_seed(0))
    loader = DataLoader(data, 16, sampler=sampler, num_workers=workers)
    forget(folder)
    steps = iter(loader)
    next(steps)  # workers have started
    children = [worker.pid for worker in getattr(steps, "_workers", ())]
    marks: list[tuple[int, float, float]] = []
    begin, done = time.perf_counter(), 0
    for x, _ in steps:
        done += len(x)
        if done * 4 // maps > len(marks):
            marks.append((done, sum(map(core_seconds, children)), memory(children)))
    seconds = time.perf_counter() - begin
    (first, start, _), (last, end, _) = marks[0], marks[-1]
    return {
        "maps_per_s": done / seconds,
        "core_ms_per_map": 1e3 * (end - start) / (last - first) if children else None,
        "workers": workers,
        "memory_mb": [held for _, _, held in marks],
    }


def sequential(folder: Path, workers: int = 0, limit: float = 4e9) -> dict[str, Any]:
    """Stored bytes a second of streaming all raw samples, and of a core in this process; the memory at quarters."""
    data = StreamingRadarDataset(folder, None, stored_words, "action", shuffle=0)
    forget(folder)
    stored = sum(path.stat().st_size for path in folder.glob("shard-*.h5"))
    whole = len(data)
    count = max(1, min(whole, int(whole * limit / stored)))
    begin, start = time.perf_counter(), time.process_time()
    held: list[float] = []
    for number, _ in enumerate(_items(data, workers, count), 1):
        if number * 4 // count > len(held):
            held.append(memory())
    seconds, busy = time.perf_counter() - begin, time.process_time() - start
    size = stored * count / whole
    core = None if workers else size / busy
    return {
        "bytes_per_s": size / seconds, "bytes_per_core_s": core, "workers": workers, "memory_mb": held,
        "recordings": count,
    }  # fmt: skip


def _items(data: StreamingRadarDataset, workers: int, count: int) -> Iterator[Any]:
    return islice(DataLoader(data, None, num_workers=workers), count)


def stored_words(run: Any, frames: slice) -> np.ndarray:
    """The ADC's words as they are stored."""
    return run.adc.words[frames]


def measure_loading(folder: Path, workers: int = 2) -> dict[str, Any]:
    """Random and sequential access of a set, beside the disk's own speed in the same run."""
    disk = disk_rate(folder)
    random = random_access(folder, workers)
    words = [sequential(folder, each) for each in (0, workers)]
    again = disk_rate(folder)
    rate = max(disk, again)
    return {"disk_bytes_per_s": [disk, again], "random": random, "sequential": words,
            "sequential_share": max(each["bytes_per_s"] for each in words) / rate}  # fmt: skip


if __name__ == "__main__":
    import json
    import sys

    print(json.dumps(measure_loading(Path(sys.argv[1])), indent=1))
