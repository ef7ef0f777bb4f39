"""Data sets of recordings for PyTorch.

    >>> from torch.utils.data import DataLoader                                     # doctest: +SKIP
    >>> train = RadarDataset("out", "train", "range_doppler", "action", window_s=0.5, transform=to_db)  # doctest: +SKIP
    >>> for x, y in DataLoader(train, batch_size=16, shuffle=True, num_workers=2): ...                  # doctest: +SKIP

Items are the same for workers that are forked and spawned: each opens the files for itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset, IterableDataset, get_worker_info

from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.windows import MAX_POINTS, RepresentationChoice, TimeWindow, WindowReader

Item = tuple[Any, Any] | dict[str, Any]
"""(x, y), or a dictionary; see :class:`RadarDataset`."""


def to_db(power: Tensor, floor: float = 1e-20) -> Tensor:
    """Powers in dB, at least that of `floor`; a `transform` for maps and images."""
    return 10 * torch.log10(power.clamp_min(floor))


class RadarDataset(Dataset[Item]):
    """Windows in time of the recordings of a set, read when they are asked for.

    Parameters
    ----------
    folder
        Folder of the set.
    split
        Name of a split; None takes all recordings.
    representation
        "adc", "range_doppler", "drai", "micro_doppler" or "point_cloud", stored or computed from the samples; or a
        function of the run and of a slice of frames; or a dictionary of these.
    labels
        A name, for items (x, y); or a list of names, for items that are dictionaries. See
        :class:`~rfgen_sionna.dataset.windows.WindowReader` for the names and their axes. "action" is a class number;
        `classes` has the names.
    radar
        Name of the radar; needed if recordings have several.
    window_s, stride_s
        Length of a window and the step between windows [s]; None takes whole recordings, and steps of a window.
    transform
        Function of the tensor x; of a dictionary of representations, of the dictionary of tensors.
    max_points
        Rows of a frame of point clouds: the strongest points, then zeros.

    Items are (x, y), or a dictionary with x at "x" (or the names of the representations) and the labels by their names.
    The first axis of x is the frame.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is there.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        split: str | None = "train",
        representation: RepresentationChoice = "range_doppler",
        labels: str | Sequence[str] = "action",
        *,
        radar: str | None = None,
        window_s: float | None = None,
        stride_s: float | None = None,
        transform: Callable[[Any], Any] | None = None,
        max_points: int = MAX_POINTS,
    ) -> None:
        self._items = _Items(
            folder, split, representation, labels, transform, radar=radar, window_s=window_s, stride_s=stride_s,
            max_points=max_points,
        )  # fmt: skip

    def __len__(self) -> int:
        """Number of windows."""
        return len(self._items.reader.windows)

    def __getitem__(self, index: int) -> Item:
        return self._items.item(self._items.reader.windows[index])

    @property
    def classes(self) -> tuple[str, ...]:
        """Actions of the whole set, of all splits, in the order of the class numbers."""
        return self._items.reader.classes

    @property
    def places(self) -> tuple[str, ...]:
        """Places of the whole set, in the order of their numbers."""
        return self._items.reader.places

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the label "joints"."""
        return self._items.reader.joint_names


class StreamingRadarDataset(IterableDataset[Item]):
    """The items of :class:`RadarDataset` in the order of the files, shuffled within a buffer.

    Each epoch goes through the shards in an order of its own. Loader workers and ranks share the recordings, each
    a contiguous part: an item appears once an epoch. With several ranks each has the same number of recordings, and the
    few that are left over change from epoch to epoch.

    Parameters
    ----------
    shuffle
        Items in the buffer from which the next one is drawn; 0 keeps the order of the files.
    seed
        Seed of the order; with the number of the epoch (:meth:`set_epoch`) it decides it.
    rank, world_size
        Number of this process and of all; None takes those of `torch.distributed`, if it is initialised.
    folder, split, representation, labels, radar, window_s, stride_s, transform, max_points
        As of :class:`RadarDataset`.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        split: str | None = "train",
        representation: RepresentationChoice = "range_doppler",
        labels: str | Sequence[str] = "action",
        *,
        shuffle: int = 256,
        seed: int = 0,
        rank: int | None = None,
        world_size: int | None = None,
        radar: str | None = None,
        window_s: float | None = None,
        stride_s: float | None = None,
        transform: Callable[[Any], Any] | None = None,
        max_points: int = MAX_POINTS,
    ) -> None:
        if shuffle < 0:
            raise ValueError(f"shuffle is {shuffle}: 0 items or more are needed")
        self._items = _Items(
            folder, split, representation, labels, transform, radar=radar, window_s=window_s, stride_s=stride_s,
            max_points=max_points,
        )  # fmt: skip
        self.rank, self.world_size = _rank(rank, world_size)
        self.shuffle, self.seed = shuffle, seed
        # Workers that persist see the number that the main process sets.
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()

    def set_epoch(self, epoch: int) -> None:
        """Choose the order of the next pass; the same number gives the same order."""
        self._epoch.fill_(epoch)

    @property
    def classes(self) -> tuple[str, ...]:
        """Actions of the whole set, of all splits, in the order of the class numbers."""
        return self._items.reader.classes

    def __len__(self) -> int:
        """Number of items of this rank in an epoch, if all recordings have the same length."""
        reader = self._items.reader
        each = len(reader.windows) // len(reader.recordings)
        return each * (len(reader.recordings) // self.world_size)

    def __iter__(self) -> Iterator[Item]:
        worker = get_worker_info()
        workers, number = (1, 0) if worker is None else (worker.num_workers, worker.id)
        random = np.random.default_rng([self.seed, int(self._epoch)])
        order = self._order(random)
        share = len(order) // self.world_size
        mine = order[self.rank * share : (self.rank + 1) * share]
        mine = mine[len(mine) * number // workers : len(mine) * (number + 1) // workers]
        own = np.random.default_rng([self.seed, int(self._epoch), self.rank, number])
        return _shuffled(self._read(mine), self.shuffle, own)

    def _order(self, random: np.random.Generator) -> list[int]:
        """Positions of the recordings, shard after shard."""
        rows = self._items.reader.recordings.rows
        shards: dict[Any, list[int]] = {}
        for position, row in enumerate(rows):
            shards.setdefault(row.shard, []).append(position)
        parts = list(shards.values())
        if self.shuffle:
            parts = [parts[index] for index in random.permutation(len(parts))]
        order = [position for part in parts for position in part]
        start = int(random.integers(len(order))) if self.shuffle and self.world_size > 1 else 0
        return order[start:] + order[:start]

    def _read(self, positions: Sequence[int]) -> Iterator[Item]:
        reader = self._items.reader
        windows: dict[int, list[TimeWindow]] = {}
        for window in reader.windows:
            windows.setdefault(window.position, []).append(window)
        for position in positions:
            run = reader.run(position)
            for window in windows.get(position, ()):
                yield self._items.item(window, run)


class _Items:
    """Items of windows."""

    def __init__(
        self,
        folder: str | PathLike[str],
        split: str | None,
        representation: RepresentationChoice,
        labels: str | Sequence[str],
        transform: Callable[[Any], Any] | None = None,
        **options: Any,
    ) -> None:
        if transform is not None and not callable(transform):
            raise TypeError(f"transform is {transform!r}: a function is needed")
        self._single, self._transform = isinstance(labels, str), transform
        names = (labels,) if isinstance(labels, str) else tuple(labels)
        self.reader = WindowReader(folder, split, representation, names, **options)

    def item(self, window: TimeWindow, run: Run | None = None) -> Item:
        run = self.reader.run(window.position) if run is None else run
        arrays = {name: _tensor(array) for name, array in self.reader.arrays(window, run).items()}
        x: Any = arrays.get("", arrays)
        if self._transform is not None:
            x = self._transform(x)
        labels = {
            name: _tensor(value) if isinstance(value, np.ndarray) else value
            for name, value in self.reader.label_values(window, run).items()
        }
        if self._single:
            return x, next(iter(labels.values()))
        return {**(x if isinstance(x, dict) else {"x": x}), **labels}


def _tensor(array: NDArray[Any]) -> Tensor:
    return torch.from_numpy(array if array.flags.writeable else array.copy())


def _rank(rank: int | None, world_size: int | None) -> tuple[int, int]:
    if rank is None and world_size is None:
        distributed = torch.distributed
        if distributed.is_available() and distributed.is_initialized():
            return distributed.get_rank(), distributed.get_world_size()
        return 0, 1
    if rank is None or world_size is None or not 0 <= rank < world_size:
        raise ValueError(f"rank is {rank!r} of world_size {world_size!r}: 0 … world_size - 1 is needed")
    return rank, world_size


def _shuffled(items: Iterator[Item], size: int, random: np.random.Generator) -> Iterator[Item]:
    """The items in the order of draws from a buffer of `size`; its memory is that of `size` items."""
    if size < 2:
        yield from items
        return
    buffer: list[Item] = []
    for item in items:
        if len(buffer) < size:
            buffer.append(item)
            continue
        place = int(random.integers(size))
        yield buffer[place]
        buffer[place] = item
    for place in random.permutation(len(buffer)):
        yield buffer[place]
