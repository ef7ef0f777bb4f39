"""Further arrays of a run, declared by :class:`rfgen_sionna.dataset.schema.StoredArray`, in its group."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna.dataset.hdf5_layout import create_fixed, create_scale, create_series, describe
from rfgen_sionna.dataset.run_storage import Storage
from rfgen_sionna.dataset.schema import StoredArray, StoredAxis, check_array_path

COUNT = "_count"
"""Ending of the array, beside a ragged one, with the number of its rows in each frame."""
_ROWS_BYTES = 1 << 16
"""Size of the blocks of a ragged array [bytes]."""


def add_array(group: h5py.Group, path: str, values: ArrayLike, declared: StoredArray, storage: Storage) -> None:
    """Store an array as a whole; ValueError if it has other axes than declared, or the path is taken."""
    check_array_path(path)
    array = np.asarray(values, declared.dtype)
    if path in group:
        raise ValueError(f"array '{path}' is in the run already")
    if array.ndim != len(declared.dims) or declared.ragged:
        raise ValueError(f"array '{path}' has shape {array.shape}; the axes {declared.dims} are declared")
    dims = _axes(group, path, declared, array.shape, storage)
    create_fixed(group, path, array, dims, declared.units, declared.description, storage)
    _note(group, path)


def append_array(
    group: h5py.Group, path: str, value: ArrayLike, declared: StoredArray, frame: int, storage: Storage
) -> None:
    """Store the value of frame number `frame` of an array."""
    array = np.asarray(value, declared.dtype)
    if array.ndim != len(declared.dims):
        raise ValueError(f"array '{path}' has shape {array.shape}; the axes {declared.dims} are declared")
    if path not in group:
        _create(group, path, array, declared, storage)
    dataset = group[path]
    inner = array.shape[1:] if declared.ragged else array.shape
    if dataset.shape[1:] != inner:
        raise ValueError(f"array '{path}' has shape {array.shape}; {dataset.shape[1:]} as in the first frame is needed")
    if not declared.ragged:
        dataset.resize(frame + 1, axis=0)
        dataset[frame] = array
        return
    counts = group[path + COUNT]
    start = int(counts[:frame].sum())
    stop = start + len(array)
    rows = dataset.dims[0][0]
    for each, new in ((dataset, array), (rows, np.arange(start, stop))):
        each.resize(stop, axis=0)
        if len(array):
            each[start:] = new
    counts.resize(frame + 1, axis=0)
    counts[frame] = len(array)


class StoredArrays(Mapping[str, StoredArray]):
    """Declarations of the arrays in the group of a run by their paths; each is read when it is asked for."""

    def __init__(self, group: h5py.Group, paths: Sequence[str]) -> None:
        self._group, self._paths = group, tuple(path for path in paths if path in group)

    def __getitem__(self, path: str) -> StoredArray:
        if path not in self._paths:
            raise KeyError(path)
        return array_declaration(self._group, path)

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)


def array_declaration(group: h5py.Group, path: str) -> StoredArray:
    """Declaration of the array at `path`, with the values of its axes."""
    dataset, ragged = group[path], path + COUNT in group
    dims = tuple(dim.label for dim in dataset.dims)
    axes = {}
    for dim in dataset.dims:
        if dim.label == "frame" or not len(dim) or (ragged and dim.label == dims[0]):
            continue
        scale = dim[0]
        text = h5py.check_string_dtype(scale.dtype) is not None
        values = scale.asstr()[:] if text else scale[:]
        axes[dim.label] = StoredAxis(values, str(scale.attrs.get("units", "")), str(scale.attrs.get("long_name", "")))
    kind, units = str(dataset.dtype), str(dataset.attrs.get("units", "1"))
    inner = dims[1:] if dims[:1] == ("frame",) else dims
    return StoredArray(inner, units, str(dataset.attrs.get("long_name", "")), kind, axes, ragged)


def array_values(group: h5py.Group, path: str, frames: int | slice) -> NDArray[Any] | list[NDArray[Any]]:
    """Values of `frames`; of a ragged array one array for each frame. Arrays without frames are given whole."""
    dataset = group[path]
    if path + COUNT not in group:
        return np.asarray(dataset[frames] if dataset.dims[0].label == "frame" else dataset[()])
    splits = np.concatenate([[0], np.cumsum(group[path + COUNT][:])])
    if isinstance(frames, slice):
        return [dataset[splits[each] : splits[each + 1]] for each in range(len(splits) - 1)[frames]]
    number = range(len(splits) - 1)[frames]
    return np.asarray(dataset[splits[number] : splits[number + 1]])


def _create(group: h5py.Group, path: str, array: NDArray[Any], declared: StoredArray, storage: Storage) -> None:
    if not declared.ragged:
        dims = _axes(group, path, declared, array.shape, storage)
        create_series(
            group, path, array.shape, array.dtype, dims, declared.units, declared.description, storage
        )  # fmt: skip
        _note(group, path)
        return
    parent = path.rpartition("/")[0]
    row = f"{parent}/{declared.dims[0]}"
    if row in group:
        raise ValueError(f"array '{path}' is ragged in '{declared.dims[0]}', and '{parent}' has that axis already")
    create_scale(group, row, np.arange(0), "row, of all frames in turn", frames=True)
    rest = StoredArray(declared.dims[1:], axes={k: v for k, v in declared.axes.items() if k != declared.dims[0]})
    dims = (row, *_axes(group, path, rest, array.shape[1:], storage))
    row_bytes = max(int(np.prod(array.shape[1:])) * array.dtype.itemsize, 1)
    chunks = (max(1, _ROWS_BYTES // row_bytes), *array.shape[1:])
    more: dict[str, Any] = {"chunks": chunks} | storage.filters(chunks, array.dtype)
    dataset = group.create_dataset(path, (0, *array.shape[1:]), array.dtype, maxshape=(None, *array.shape[1:]), **more)
    describe(group, dataset, dims, declared.units, declared.description)
    text = f"number of rows of {path.rpartition('/')[2]}"
    create_series(group, path + COUNT, (), np.int64, (), "1", text)
    _note(group, path)


def _axes(
    group: h5py.Group, path: str, declared: StoredArray, shape: tuple[int, ...], storage: Storage
) -> tuple[str, ...]:
    """Paths of the axes of an array in its group, or a group above it, created where they are not there."""
    found, parent = [], path.rpartition("/")[0]
    for dim, length in zip(declared.dims, shape, strict=True):
        axis, here = declared.axes.get(dim), f"{parent}/{dim}"
        if axis is None and (above := _known(group, parent, dim, length)):
            found.append(above)
            continue
        values: Any = np.arange(length) if axis is None else axis.values
        if len(values) != length:
            raise ValueError(f"array '{path}' has shape {shape}; its axis '{dim}' has {len(values)} values")
        text = len(values) > 0 and isinstance(values[0], str)
        values = list(values) if text else np.asarray(values)
        if here not in group:
            create_scale(group, here, values, axis.description if axis else dim, storage)
            if axis is not None and axis.units and not text:
                group[here].attrs["units"] = axis.units
        elif not np.array_equal(group[here].asstr()[:] if text else group[here][:], values):
            raise ValueError(f"array '{path}' has another axis '{dim}' than the other arrays in '{parent}'")
        found.append(here)
    return tuple(found)


def _known(group: h5py.Group, parent: str, dim: str, length: int) -> str:
    """Path of the axis `dim` of that length in the group `parent`, or the nearest one above it; empty without one."""
    parts = parent.split("/")
    for depth in range(len(parts), -1, -1):
        at = "/".join([*parts[:depth], dim])
        if at in group and isinstance(group[at], h5py.Dataset) and group[at].is_scale and group[at].shape == (length,):
            return at
    return ""


def _note(group: h5py.Group, path: str) -> None:
    group.attrs["arrays"] = json.dumps(sorted({*json.loads(group.attrs.get("arrays", "[]")), path}))
