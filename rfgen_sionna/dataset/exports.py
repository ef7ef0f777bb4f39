"""Exports of a data set: WebDataset shards, plain NumPy files, and the layouts of published pipelines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.dataset.export_folder import (
    Progress,
    file_name,
    new_folder,
    save_array,
    save_record,
    save_table,
    split_folder,
)
from rfgen_sionna.dataset.gesture_layout import to_di_gesture
from rfgen_sionna.dataset.mesh_layout import to_mmmesh
from rfgen_sionna.dataset.radhar_layout import to_radhar
from rfgen_sionna.dataset.windows import RepresentationChoice, TimeWindow, WindowReader

SHARD_BYTES = 1e9
"""Size of a WebDataset shard beyond which the next one begins."""


def to_npy(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    representation: RepresentationChoice = "range_doppler",
    labels: Sequence[str] = ("action",),
    *,
    split: str | None = None,
    radar: str | None = None,
    window_s: float | None = None,
    stride_s: float | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a folder of `.npy` files, without pickles, with their labels in `labels.csv`.

    A window of recording 12 that begins in frame 20 is `train/range_doppler/000012-0020.npy`. Labels that are arrays
    are files likewise (`train/joints/...`), others are columns of the table. `dataset.json` has the classes, axes,
    units and coordinates.

    Parameters
    ----------
    representation, labels, split, radar, window_s, stride_s
        As of :class:`~rfgen_sionna.dataset.windows.WindowReader`; a single function has the name "x".
    progress
        Function of the number of finished windows and of all.

    Raises
    ------
    OutputError
        If the folder exists already, or cannot be written.
    ValueError
        For representations and labels that are not there.
    """
    windows: dict[str, Any] = {"split": split, "radar": radar, "window_s": window_s, "stride_s": stride_s}
    with _export(folder, output, representation, labels, overwrite, **windows) as (target, reader):
        table = []
        for window, row, arrays, values in _windows(reader, progress):
            name = _name(row.number, window)
            for key, array in (arrays | _arrays(values)).items():
                save_array(target / split_folder(row.split) / file_name(key) / f"{name}.npy", array)
            table.append(_place(row, window) | {"file": f"{name}.npy"} | _columns(reader, values))
        save_table(target / "labels.csv", table)
    return Path(output)


def to_webdataset(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    representation: RepresentationChoice = "range_doppler",
    labels: Sequence[str] = ("action",),
    *,
    split: str | None = None,
    radar: str | None = None,
    window_s: float | None = None,
    stride_s: float | None = None,
    shard_bytes: float = SHARD_BYTES,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write `SPLIT-000000.tar`, … for the library webdataset: `.npy` arrays, class numbers as `.cls`, the rest as JSON.

        >>> import webdataset                                                       # doctest: +SKIP
        >>> set = webdataset.WebDataset("out/train-{000000..000003}.tar").decode()  # doctest: +SKIP
        >>> set.to_tuple("range_doppler.npy", "action.cls")                         # doctest: +SKIP

    Same set, same bytes. Arguments and errors are those of :func:`to_npy`; ImportError without webdataset.
    """
    try:
        from webdataset import TarWriter
    except ImportError as error:
        raise ImportError("to_webdataset needs the library webdataset: pip install webdataset") from error
    windows: dict[str, Any] = {"split": split, "radar": radar, "window_s": window_s, "stride_s": stride_s}
    with _export(folder, output, representation, labels, overwrite, **windows) as (target, reader):
        writers: dict[str, tuple[int, int, Any]] = {}
        try:
            for window, row, arrays, values in _windows(reader, progress):
                count, size, writer = writers.get(row.split, (0, 0, None))
                if writer is None or size > shard_bytes:
                    if writer is not None:
                        writer.close()
                    file = target / f"{split_folder(row.split)}-{count:06d}.tar"
                    count, size, writer = count + 1, 0, TarWriter(str(file), mtime=0, user="", group="")
                item: dict[str, Any] = {"__key__": _name(row.number, window)}
                item |= {
                    f"{file_name(key)}.npy": np.asarray(array) for key, array in (arrays | _arrays(values)).items()
                }
                item |= {f"{key}.cls": values[key] for key in ("action", "place") if key in values}
                item["json"] = _place(row, window) | _columns(reader, values)
                writers[row.split] = count, size + writer.write(item), writer
        finally:
            for _, _, writer in writers.values():
                writer.close()
    return Path(output)


EXPORTS: Mapping[str, Callable[..., Path]] = {
    "webdataset": to_webdataset, "npy": to_npy, "radhar": to_radhar, "mmmesh": to_mmmesh, "di_gesture": to_di_gesture,
}  # fmt: skip
"""Functions that export a data set, by the names of their formats."""


def export_dataset(folder: str | PathLike[str], output: str | PathLike[str], format: str, **options: Any) -> Path:
    """Export a data set in a format of :data:`EXPORTS`; `options` are those of its function.

    Raises
    ------
    ValueError
        If the format is unknown, or as the function of the format raises it.
    """
    if format not in EXPORTS:
        raise ValueError(f"format is {format!r}: allowed are {', '.join(map(repr, EXPORTS))}")
    return EXPORTS[format](folder, output, **options)


@contextmanager
def _export(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    representation: RepresentationChoice,
    labels: Sequence[str],
    overwrite: bool,
    split: str | None = None,
    **windows: Any,
) -> Iterator[tuple[Path, WindowReader]]:
    """New folder and the windows that it is to have; their record is written at the end."""
    named = representation
    if not isinstance(representation, Mapping):
        named = {representation if isinstance(representation, str) else "x": representation}
    if isinstance(labels, str):
        labels = (labels,)
    reader = WindowReader(folder, split, named, labels, alike=False, **windows)
    with new_folder(output, overwrite) as target:
        yield target, reader
        save_record(target / "dataset.json", _record(reader))


def _windows(reader: WindowReader, progress: Progress | None) -> Iterator[tuple[TimeWindow, Any, Any, Any]]:
    """Each window with the row of its recording, its arrays and its labels."""
    for number, window in enumerate(reader.windows, 1):
        run, row = reader.run(window.position), reader.recordings.rows[window.position]
        yield window, row, reader.arrays(window, run), reader.label_values(window, run)
        if progress is not None:
            progress(number, len(reader.windows))


def _name(number: int, window: TimeWindow) -> str:
    return f"{number:06d}-{window.first:04d}"


def _place(row: Any, window: TimeWindow) -> dict[str, Any]:
    """Where a window comes from."""
    return {"split": row.split, "recording": row.number, "first_frame": window.first, "frames": window.count}


def _arrays(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _columns(reader: WindowReader, values: Mapping[str, Any]) -> dict[str, Any]:
    """Labels that are single numbers, and the names of classes."""
    found = {name: value for name, value in values.items() if not isinstance(value, np.ndarray)}
    names = {"action": reader.classes, "place": reader.places}
    for name in names:
        if name in found:
            found[f"{name}_name"] = names[name][found[name]]
    return {name: None if value != value else value for name, value in found.items()}  # NaN is no JSON


def _record(reader: WindowReader) -> dict[str, Any]:
    """Classes, axes, units and coordinates."""
    window = reader.windows[0]
    run, row = reader.run(window.position), reader.recordings.rows[window.position]
    arrays: dict[str, Any] = {}
    for name, each in reader.representations.items():
        if isinstance(each, str):
            found = run.representation(each, slice(0, 1))
            ragged = found.row_splits is not None
            arrays[name] = {
                "dims": ["frame", *found.dims] if ragged else list(found.dims),
                "units": found.units,
                "axes": {dim: np.asarray(values).tolist() for dim, values in found.axes.items()},
            }
    return {
        "source": "rfgen_sionna", "recipe": reader.recordings.recipe_text, "radar": run.radar.to_dict(),
        "classes": list(reader.classes), "places": list(reader.places), "joints": list(reader.joint_names),
        "arrays": arrays, "labels": list(reader.labels), "example": _place(row, window),
    }  # fmt: skip
