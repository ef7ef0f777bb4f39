"""Shards of a data set: HDF5 files with the runs of many recordings, equal bytes for equal recordings.

A shard holds no time and nothing of how, where or in which order its recordings were made: their arrays are copied in
alphabetical order, blocks as they are stored.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import h5py

from rfgen_sionna.dataset.guarded_file import GuardedFile
from rfgen_sionna.dataset.recording_digest import (
    DERIVED,
    axes_of,
    objects_of,
    recording_digest,
    scale_paths,
    shard_recordings,
    update_with_dataset,
)  # fmt: skip
from rfgen_sionna.dataset.run_file import check_format, open_hdf5
from rfgen_sionna.dataset.run_storage import Storage
from rfgen_sionna.dataset.schema import FORMAT, RADARS, RECORDINGS, SHARD_FORMAT, VERSION, RunFormatError
from rfgen_sionna.dataset.whole_files import whole_file

LIBVER = ("v110", "v110")
"""Version of HDF5 for the structures of shards, which then have checksums."""
__all__ = ["assemble_shard", "copy_run", "extract_recording", "recording_digest", "shard_recordings"]

_PACKED = Storage(compressed=True)
COMPACT = 8192
"""Size [bytes] up to which an array is stored in its header, which has a checksum."""


def recording_name(number: int) -> str:
    """Name of the group of recording `number`, "000123"."""
    return f"{number:06d}"


def assemble_shard(target: Path, parts: Mapping[int, Path], attributes: Mapping[str, str] | None = None) -> None:
    """Write a shard with the runs in the files `parts`, by number of recording; a file at `target` is replaced.

    The shard is there whole or not at all, also after a crash of the machine. Radars of one recording share arrays
    that are equal.

    Parameters
    ----------
    target
        File of the shard.
    parts
        Run file of each recording, by its number.
    attributes
        Further attributes of the shard, such as the recipe.

    Raises
    ------
    RunFormatError
        If a part is no run file.
    OSError
        If the shard cannot be written, such as on a full disk; nothing is left then.
    """
    with whole_file(target) as temporary, closing(GuardedFile(temporary)) as guarded:
        with h5py.File(guarded, "w", libver=LIBVER) as shard:
            heading = {"format": SHARD_FORMAT, "format_version": VERSION, "Conventions": f"{FORMAT}-{VERSION}"}
            shard.attrs.update(heading | dict(sorted((attributes or {}).items())))
            recordings = shard.create_group(RECORDINGS)
            for number, part in sorted(parts.items()):
                with open_hdf5(part) as source:
                    check_format(part, source, FORMAT)
                    copied = recordings.create_group(recording_name(number))
                    copy_run(source, copied)
                    copied.attrs["digest"] = recording_digest(source)
                guarded.check()
        guarded.check()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def copy_run(source: h5py.Group, target: h5py.Group) -> None:
    """Copy a run, of one or several radars, into an empty group; equal arrays of several radars are one."""
    names = json.loads(source.attrs.get(RADARS, "[]"))
    if not names:
        _copy(source, target, None)
        return
    _copy_attributes(source, target)
    radars = target.create_group(RADARS)
    shared: dict[tuple[str, str], h5py.Dataset] = {}
    for name in names:
        _copy(source[f"{RADARS}/{name}"], radars.create_group(name), shared)


def _copy(source: h5py.Group, target: h5py.Group, shared: dict[tuple[str, str], h5py.Dataset] | None) -> None:
    """Copy all of a group; `shared` are arrays that are there already, by path and digest; None for a single radar."""
    _copy_attributes(source, target)
    groups, datasets = objects_of(source)
    for path in groups:
        _copy_attributes(source[path], target.require_group(path))
    made, scales = [], scale_paths(datasets)
    # Axes first, so that arrays find theirs.
    for path in sorted(datasets, key=lambda each: (not datasets[each].is_scale, each)):
        digest = hashlib.sha256()
        if shared is not None:
            update_with_dataset(digest, path, datasets[path], scales)
            if (known := shared.get((path, digest.hexdigest()))) is not None:
                target[path] = known
                continue
        copy = _copy_dataset(datasets[path], target, path)
        if shared is not None:
            shared[path, digest.hexdigest()] = copy
        made.append(path)
    for path in made:
        copy = target[path]
        for axis, (label, values) in enumerate(axes_of(path, datasets[path], scales)):
            if label:
                copy.dims[axis].label = label
            for each in filter(None, values):
                copy.dims[axis].attach_scale(target[each])


def _copy_dataset(original: h5py.Dataset, target: h5py.Group, path: str) -> h5py.Dataset:
    text = h5py.check_string_dtype(original.dtype) is not None
    shape, kind = original.shape, original.dtype
    if text or original.nbytes <= COMPACT:
        plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plan.set_obj_track_times(False)
        if not text:
            plan.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple(shape) if shape else h5py.h5s.create(h5py.h5s.SCALAR)
        made = h5py.Dataset(h5py.h5d.create(target.id, path.encode(), original.id.get_type(), space, dcpl=plan))
        if original.size:
            made[()] = original[()]
    else:
        blocks = tuple(map(min, original.chunks or shape, shape))
        options = {"track_times": False} | _PACKED.filters(blocks, kind)
        made = target.create_dataset(path, shape, kind, **options)
        if made.chunks == original.chunks and _filters(made) == _filters(original):
            _copy_blocks(original, made)
        else:
            # Blocks written as such, in order, whatever those of the original are.
            with h5py.File("packed", "w", driver="core", backing_store=False, libver=LIBVER) as memory:
                packed = memory.create_dataset("values", shape, kind, **options)
                for start in range(0, shape[0], blocks[0]):
                    packed[start : start + blocks[0]] = original[start : start + blocks[0]]
                memory.flush()
                _copy_blocks(packed, made)
    _copy_attributes(original, made)
    if original.is_scale:
        made.make_scale(path.rpartition("/")[2])
    return made


def _copy_blocks(original: h5py.Dataset, made: h5py.Dataset) -> None:
    if made.chunks is None:
        made[()] = original[()]
        return
    for number in range(original.id.get_num_chunks()):
        found = original.id.get_chunk_info(number)
        mask, block = original.id.read_direct_chunk(found.chunk_offset)
        made.id.write_direct_chunk(found.chunk_offset, block, mask)


def _filters(dataset: h5py.Dataset) -> list[Any]:
    """Filters of a dataset with their parameters."""
    plan = dataset.id.get_create_plist()
    return [plan.get_filter(number)[:3] for number in range(plan.get_nfilters())]


def _copy_attributes(source: h5py.HLObject, target: h5py.HLObject) -> None:
    for name in sorted(source.attrs):
        if name not in DERIVED:
            value = source.attrs[name]
            target.attrs[name] = value


def extract_recording(shard: Path, number: int, target: Path) -> None:
    """Write the run of a recording in a shard to a run file of its own; a file at `target` is replaced.

    RunFormatError if the shard has no such recording.
    """
    with whole_file(target) as temporary, closing(GuardedFile(temporary)) as guarded:
        with open_hdf5(shard) as file, h5py.File(guarded, "w", libver=LIBVER) as made:
            check_format(shard, file, SHARD_FORMAT)
            name = f"{RECORDINGS}/{recording_name(number)}"
            if name not in file:
                raise RunFormatError(f"'{shard}' has no recording {number}")
            copy_run(file[name], made)
        guarded.check()
