"""Propagation paths in a run file, frame by frame.

    /paths/static/0/…    paths of the static scene: the same in every frame
    /paths/000003/0/…    paths of frame 3, one group for each set of knots

Each group has the arrays of :class:`~rfgen_sionna.records.RadarPaths`, without a loss; rates are those of the spline
through the delays. `paths` has the attribute `num_static`, the number of objects at rest, which share one tolerance.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import h5py
import hdf5plugin
import numpy as np

from rfgen_sionna.dataset.schema import RunFormatError
from rfgen_sionna.records import RadarPaths, knot_weights

PATHS = "paths"
"""Group of the paths in a run."""
_UNITS = {
    "a": "1", "tau": "s", "tau_rate": "1", "times": "s", "direction": "1", "arrival": "1", "object_id": "",
    "part_id": "", "kind": "", "bounces": "", "facet": "", "dispersion": "1",
}  # fmt: skip
_DIMS = {
    "a": ("tx_element", "rx", "path", "time"), "tau": ("tx_element", "rx", "path", "time"),
    "tau_rate": ("tx_element", "rx", "path", "time"), "times": ("time",), "direction": ("path", "time", "axis"),
    "arrival": ("path", "time", "axis"), "dispersion": ("order", "tx_element", "rx", "path", "time"),
}  # fmt: skip


def write_static_paths(group: h5py.Group, paths: Sequence[RadarPaths], num_static: int) -> None:
    """Write the paths of the static scene to the `group` of a run; those that are there stay."""
    stored = group.require_group(PATHS)
    if "static" not in stored:
        stored.attrs["num_static"] = num_static
        _write(stored.create_group("static"), paths)


def write_frame_paths(group: h5py.Group, number: int, paths: Sequence[RadarPaths]) -> None:
    """Write the paths of frame `number` to the `group` of a run; those of a frame that was cut short are replaced."""
    stored, name = group.require_group(PATHS), f"{number:06d}"
    if name in stored:
        del stored[name]
    _write(stored.create_group(name), paths)


def read_static_paths(stored: h5py.Group) -> tuple[tuple[RadarPaths, ...], int]:
    """Paths of the static scene in a group of paths, and the number of static objects; RunFormatError if it has other
    contents."""
    try:
        return _read(stored["static"]), int(stored.attrs["num_static"])
    except (KeyError, ValueError, TypeError) as error:
        raise RunFormatError(f"{stored.file.filename}: 'paths/static' has other contents: {error}") from error


def read_frame_paths(stored: h5py.Group, number: int) -> tuple[RadarPaths, ...]:
    """Paths of frame `number` in a group of paths, but those of the static scene; RunFormatError if it has other
    contents."""
    name = f"{number:06d}"
    try:
        return _read(stored[name])
    except (KeyError, ValueError, TypeError) as error:
        raise RunFormatError(f"{stored.file.filename}: 'paths/{name}' has other contents: {error}") from error


def _write(group: h5py.Group, paths: Sequence[RadarPaths]) -> None:
    for index, each in enumerate(paths):
        own = group.create_group(str(index))
        own.attrs["frequency"], own.attrs["half_band"] = each.frequency, each.half_band
        own.attrs["object_names"], own.attrs["part_names"] = json.dumps(each.object_names), json.dumps(each.part_names)
        for name, unit in _UNITS.items():
            values = getattr(each, name)
            if values is None:
                continue
            if name == "tau_rate" and len(each.times) > 1 and np.any(values):
                continue  # that of the spline through tau
            if name == "arrival" and np.array_equal(values, each.direction):
                own[name] = own["direction"]
                continue
            array = np.asarray(values)
            packed: dict[str, Any] = dict(hdf5plugin.Bitshuffle(cname="lz4")) if array.size > 1000 else {}
            dataset = own.create_dataset(name, data=array, **packed)
            if unit:
                dataset.attrs["units"] = unit
            for axis, dim in enumerate(_DIMS.get(name, ("path",))):
                dataset.dims[axis].label = dim


def _read(group: h5py.Group) -> tuple[RadarPaths, ...]:
    found = []
    for index in range(len(group)):
        own = group[str(index)]
        arrays: dict[str, Any] = {name: own[name][()] if name in own else None for name in _UNITS}
        if arrays["tau_rate"] is None:
            arrays["tau_rate"] = arrays["tau"] @ knot_weights(arrays["times"], arrays["times"], 1).T
        arrays |= {name: tuple(json.loads(own.attrs[name])) for name in ("object_names", "part_names")}
        arrays |= {name: float(own.attrs[name]) for name in ("frequency", "half_band")}
        found.append(RadarPaths(**arrays))
    return tuple(found)
