"""Digest of what a recording means; as a program, a reader of all of a shard, in a process that may end.

The program imports nothing of the package, which takes longer than to read a shard. It prints the number and the digest
of each recording, and ends with an error where something cannot be read or is not what shards have.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import h5py
import hdf5plugin  # noqa: F401  (registers the filter)
import numpy as np

DERIVED = ("DIMENSION_LABELS", "DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME", "_Netcdf4Dimid", "digest")
"""Attributes that follow from the axes, or from all of a recording."""
_FILTERS = (3, 32008)  # Fletcher-32, bitshuffle
_MAX_MEMORY, _MAX_BLOCK = 16 << 30, 1 << 30  # bytes


def objects_of(group: h5py.Group) -> tuple[list[str], dict[str, h5py.Dataset]]:
    """Paths of the groups in a group, and its datasets by their paths, in alphabetical order."""
    groups: list[str] = []
    datasets: dict[str, h5py.Dataset] = {}

    def look(inner: h5py.Group, before: str) -> None:
        for name in sorted(inner):
            item = inner.get(name, getlink=True)
            if not isinstance(item, h5py.HardLink):
                raise ValueError(f"'{group.file.filename}': '{before}{name}' is a link to another place")
            item = inner[name]
            if isinstance(item, h5py.Group):
                groups.append(f"{before}{name}")
                look(item, f"{before}{name}/")
            elif isinstance(item, h5py.Dataset):
                datasets[f"{before}{name}"] = item

    look(group, "")
    return groups, datasets


def recording_digest(group: h5py.Group) -> str:
    """SHA-256 of what the group of a recording means, in hexadecimal digits: names, types, shapes, values, attributes
    and axes. It does not depend on blocks, compression and sharing: that of a run file is that of its copy in a shard.
    """
    digest = hashlib.sha256()
    groups, datasets = objects_of(group)
    _digest_attributes(digest, "", group)
    for path in groups:
        _digest_attributes(digest, path, group[path])
    scales = scale_paths(datasets)
    for path in sorted(datasets):
        update_with_dataset(digest, path, datasets[path], scales)
    return digest.hexdigest()


def shard_recordings(shard: h5py.File) -> Iterator[tuple[int, h5py.Group]]:
    """Numbers and groups of the recordings in an open shard."""
    for name in sorted(shard["recordings"]):
        yield int(name), shard["recordings"][name]


def scale_paths(datasets: Mapping[str, h5py.Dataset]) -> dict[int, list[str]]:
    """Paths of the axes among `datasets`, by their addresses in the file; radars of a recording may share them."""
    found: dict[int, list[str]] = {}
    for path, dataset in datasets.items():
        if dataset.is_scale:
            found.setdefault(_address(dataset), []).append(path)
    return found


def axes_of(path: str, dataset: h5py.Dataset, scales: Mapping[int, list[str]]) -> list[tuple[str, list[str]]]:
    """Name of each axis of the dataset at `path`, with the paths of its values, the nearest of several."""

    def nearest(scale: h5py.Dataset) -> str:
        known = scales.get(_address(scale), [])
        return max(known, key=lambda each: (len(os.path.commonpath([each, path])), each), default="")

    return [(dim.label, [nearest(scale) for scale in dim.values()]) for dim in dataset.dims]


def _address(dataset: h5py.Dataset) -> int:
    return int(h5py.h5o.get_info(dataset.id).addr)


def update_with_dataset(digest: Any, path: str, dataset: h5py.Dataset, scales: Mapping[int, list[str]]) -> None:
    """Add a dataset at `path` in the group of a run to a digest; `scales` are those of :func:`scale_paths`."""
    axes = axes_of(path, dataset, scales)
    _update(digest, [path, str(dataset.dtype), list(dataset.shape), dataset.is_scale, axes])
    _digest_attributes(digest, path, dataset)
    if h5py.check_string_dtype(dataset.dtype) is not None:
        _update(digest, np.asarray(dataset.asstr()[()]).tolist())
    elif dataset.chunks is not None and dataset.ndim and dataset.size:
        step = dataset.chunks[0]
        for start in range(0, dataset.shape[0], step):
            digest.update(np.ascontiguousarray(dataset[start : start + step]).data)
    elif dataset.size:
        digest.update(np.ascontiguousarray(dataset[()]).data)


def _digest_attributes(digest: Any, path: str, item: h5py.HLObject) -> None:
    for name in sorted(item.attrs):
        if name in DERIVED:
            continue
        value = item.attrs[name]
        array = np.asarray(value)
        plain = value if isinstance(value, str) else array.tolist()
        _update(digest, [path, name, str(array.dtype.kind), list(array.shape), plain])


def _update(digest: Any, value: Any) -> None:
    digest.update(json.dumps(value, default=repr).encode())


def examine(path: str) -> None:
    """Read all of a shard, printing the digest of each recording; ValueError or OSError at the first fault."""
    with h5py.File(path, "r") as shard:
        faults = 0
        for number, group in shard_recordings(shard):
            try:
                for name, dataset in objects_of(group)[1].items():
                    check_dataset(name, dataset)
                digest = recording_digest(group)
            except Exception as error:
                print(f"recording {number}: {type(error).__name__}: {error}", file=sys.stderr)  # noqa: T201
                faults += 1
                continue
            print(number, digest, flush=True)  # noqa: T201
            if digest != group.attrs.get("digest"):
                print(f"recording {number}: its digest is another", file=sys.stderr)  # noqa: T201
                faults += 1
        if faults:
            raise ValueError(f"{faults} recordings cannot be read")


def check_dataset(name: str, dataset: h5py.Dataset) -> None:
    """ValueError if a dataset has what no shard has: data elsewhere, other filters, blocks without a bound."""
    if dataset.external or dataset.is_virtual:
        raise ValueError(f"'{name}' has its values in another file")
    plan = dataset.id.get_create_plist()
    filters = [plan.get_filter(each) for each in range(plan.get_nfilters())]
    size = dataset.dtype.itemsize
    known = all(found[0] != 32008 or found[2] == (*found[2][:2], size, 0, 2) for found in filters)
    if not known or any(found[0] not in _FILTERS for found in filters):
        raise ValueError(f"'{name}' has the filters {[found[:3] for found in filters]}")
    block = int(np.prod(dataset.chunks or dataset.shape, dtype=float)) * size
    if block > _MAX_BLOCK or dataset.nbytes > 1024 * max(dataset.id.get_storage_size(), 1 << 20):
        raise ValueError(f"'{name}' has {dataset.nbytes} bytes in blocks of {block}")


if __name__ == "__main__":
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MAX_MEMORY, _MAX_MEMORY))
    except (ImportError, ValueError, OSError):  # a system without such limits, or with lower ones
        pass
    examine(sys.argv[1])
