"""Datasets, axes and attributes of a run file, as :mod:`rfgen_sionna.dataset.schema` describes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import h5py
import numpy as np

from rfgen_sionna.dataset.schema import AXES, FORMAT, PIR_CHANNELS, RADARS, VERSION, ActorInfo, Label, RunInfo
from rfgen_sionna.records import Pir

FAR = 1e3
"""Coordinate of a radar [m] beyond which meshes are stored as float64: float32 numbers are 0.06 mm apart."""
_TEXT = h5py.string_dtype()


def _created() -> dict[str, str]:
    """Attributes of every file."""
    return {
        "Conventions": f"{FORMAT}-{VERSION}", "format": FORMAT, "format_version": VERSION,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }  # fmt: skip


def _settings(info: RunInfo) -> dict[str, str]:
    """Attributes that determine the frames of a run."""
    return {
        "prompt": info.prompt, "negative_prompt": info.negative_prompt, "environment": info.environment,
        "receiver": "" if info.receiver is None else json.dumps(info.receiver),
        "radar": json.dumps(info.radar.to_dict()),
        "seeds": json.dumps({name: None if seed is None else int(seed) for name, seed in info.seeds.items()}),
        "settings": json.dumps(dict(info.settings)),
    }  # fmt: skip


def create_radars(file: h5py.File, infos: Mapping[str, RunInfo]) -> None:
    """Create a file for several radars, each with a group for its run."""
    file.attrs.update(_created() | {RADARS: json.dumps(list(infos))})
    file.create_group(RADARS)


def run_difference(file: h5py.Group, info: RunInfo | Mapping[str, RunInfo]) -> str:
    """First difference between a file and a run, "NAME is VALUE instead of VALUE"; empty if they are the same run."""
    if isinstance(info, Mapping):
        names = json.loads(file.attrs.get(RADARS, "[]"))
        if names != list(info):
            return f"radars are {names} instead of {list(info)}"
        found = ((name, run_difference(file[f"{RADARS}/{name}"], each)) for name, each in info.items())
        return next((f"radar '{name}' has another run: its {text}" for name, text in found if text), "")
    for name, value in _settings(info).items():
        old = str(file.attrs.get(name, ""))
        if old == value:
            continue
        both_tables = name not in ("prompt", "negative_prompt", "environment") and old and value
        tables = [json.loads(text) if both_tables else {"": text} for text in (old, value)]
        for key in (*tables[1], *tables[0]):
            before, after = (table.get(key) for table in tables)
            if before != after:
                return f"{name}{'.' if key else ''}{key} is {_short(before)} instead of {_short(after)}"
    return ""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def create_run(file: h5py.Group, info: RunInfo) -> None:
    """Create everything but labels and PIR, whose shapes are those of the first frame."""
    radar, wave = info.radar, info.radar.waveform
    software = {"report": info.report, "software": json.dumps(dict(info.software))}
    file.attrs.update(_created() | _settings(info) | software)
    _scale(file, "frame", np.arange(0), "frame number", frames=True)
    _scale(file, "chirp", np.arange(wave.num_loops), "loop within the frame")
    by_element = radar.axis_names == radar.tx_names
    _scale(file, "tx", list(radar.axis_names), "transmit element" if by_element else "slot, with its active elements")
    _scale(file, "rx", list(radar.rx_names), "receive element")
    _scale(file, "sample", np.arange(wave.num_samples), "ADC sample within the chirp")
    meaning = "real samples" if radar.adc.real else "complex baseband"
    _series(
        file, "adc", radar.frame_shape, radar.sample_type, ("chirp", "tx", "rx", "sample"), "sqrt(W)",
        f"{meaning} at the receiver input: |sample|² is power",
    )  # fmt: skip
    _series(file, "frame_time", (), np.float64, (), "s", "start of the first ramp of the frame")
    _series(file, "mesh_time", (), np.float64, (), "s", "time of meshes, joints and labels")
    _fixed(file, "chirp_time", wave.chirp_times, ("chirp", "tx"), "s", "start of the ramp in the frame")
    if wave.other_profiles:
        times = [wave.profiles[wave.slots[slot].profile].sample_times(wave.num_samples) for slot in wave.axis_slots]
        _fixed(file, "sample_time", np.stack(times), ("tx", "sample"), "s", "time after the start of the ramp")
    else:
        _fixed(file, "sample_time", wave.sample_times, ("sample",), "s", "time after the start of the ramp")
    _scale(file, "axis", list(AXES), "component in the world frame")
    if not by_element:
        _scale(file, "tx_element", list(radar.tx_names), "transmit element")
        phases = np.stack([slot.phases(1, wave.phase_step_deg)[0] for slot in wave.slots])
        _fixed(file, "tx_phase", phases, ("tx", "tx_element"), "degree", "phase in the first loop; NaN where it is off")
        advance = np.array([slot.advance_deg or (0.0,) * wave.num_tx for slot in wave.slots])
        _fixed(file, "tx_advance", advance, ("tx", "tx_element"), "degree", "growth of that phase from loop to loop")
    place = ("tx" if by_element else "tx_element", "axis")
    _fixed(file, "tx_position", radar.tx_positions, place, "m", "element position, device frame")
    _fixed(file, "rx_position", radar.rx_positions, ("rx", "axis"), "m", "element position, device frame")
    file.create_group("labels")
    file.create_group("actors")
    if info.actors:
        _scale(file, "actor", [actor.name for actor in info.actors], "name of the actor")
    far = np.abs(radar.position).max() > FAR
    for actor in info.actors:
        _create_actor(file, actor, np.float64 if far else np.float32)


def _create_actor(file: h5py.Group, actor: ActorInfo, number: type[np.floating[Any]]) -> None:
    at = f"actors/{actor.name}"
    file.create_group(at).attrs["material"] = actor.material
    _scale(file, f"{at}/vertex", np.arange(actor.num_vertices, dtype=np.int32), "vertex number")
    _scale(file, f"{at}/face", np.arange(len(actor.faces), dtype=np.int32), "face number")
    _scale(file, f"{at}/corner", np.arange(3, dtype=np.int32), "corner of the face")
    _scale(file, f"{at}/part", list(actor.part_names), "name of the body part")
    face, corner = f"{at}/face", f"{at}/corner"
    _fixed(file, f"{at}/faces", actor.faces, (face, corner), "", "vertex numbers, counter-clockwise from outside")
    _fixed(file, f"{at}/face_part", actor.face_parts, (face,), "", "index into part")
    _series(
        file, f"{at}/vertices", (actor.num_vertices, 3), number, (f"{at}/vertex", "axis"), "m",
        "vertex position, world frame",
    )  # fmt: skip
    if actor.joint_names:
        _scale(file, f"{at}/joint", list(actor.joint_names), "name of the joint")
        _series(
            file, f"{at}/joints", (len(actor.joint_names), 3), number, (f"{at}/joint", "axis"), "m",
            "joint position, world frame",
        )  # fmt: skip


def create_label(file: h5py.Group, name: str, label: Label, shape: tuple[int, ...]) -> None:
    """Create the series of a label with values of `shape`; ValueError if it has other axes than declared."""
    if len(shape) != len(label.dims):
        raise ValueError(f"label '{name}' has shape {shape}; the axes {label.dims} are declared")
    dims = []
    for dim, length in zip(label.dims, shape, strict=True):
        at = dim if dim in file and file[dim].is_scale else f"labels/{dim}"
        if at not in file:
            _scale(file, at, np.arange(length), dim)
        if file[at].shape != (length,):
            raise ValueError(f"label '{name}' has shape {shape}; '{dim}' has {file[at].shape[0]} entries")
        dims.append(at)
    kind = _TEXT if label.text else np.float64
    _series(file, f"labels/{name}", shape, kind, tuple(dims), label.units, label.description)


def create_pir(file: h5py.Group, pir: Pir) -> None:
    """Create the series of images with the pixels, field of view and projection of `pir`."""
    rows, columns = np.shape(pir.energy)
    file.create_group("pir").attrs.update({"fov_deg": pir.fov_deg, "projection": pir.projection})
    _scale(file, "pir/channel", list(PIR_CHANNELS), "quantity")
    _scale(file, "pir/row", np.arange(rows), "0 is the top")
    _scale(file, "pir/column", np.arange(columns), "0 is the left side seen from the radar")
    _fixed(file, "pir/channel_units", list(PIR_CHANNELS.values()), ("pir/channel",), "", "units of each channel")
    _series(
        file, "pir/image", (len(PIR_CHANNELS), rows, columns), np.float32, ("pir/channel", "pir/row", "pir/column"),
        "see channel_units", "energy is |path gain|² of isotropic elements",
    )  # fmt: skip
    _series(file, "pir/time", (), np.float64, (), "s", "time of the image")
    _series(file, "pir/position", (3,), np.float64, ("axis",), "m", "viewpoint, world frame")
    _scale(file, "pir/angle", ["yaw", "pitch", "roll"], "rotation")
    _series(file, "pir/orientation", (3,), np.float64, ("pir/angle",), "rad", "orientation of the viewpoint")


def _scale(file: h5py.Group, name: str, values: Any, description: str, *, frames: bool = False) -> None:
    text = isinstance(values, list)
    dataset = file.create_dataset(
        name, data=values, dtype=_TEXT if text else None, maxshape=(None,) if frames else None,
        chunks=(1024,) if frames else None,
    )  # fmt: skip
    dataset.attrs["long_name"] = description
    dataset.make_scale(name.rpartition("/")[2])


def _fixed(file: h5py.Group, name: str, values: Any, dims: tuple[str, ...], units: str, description: str) -> None:
    kind = _TEXT if isinstance(values, list) else None
    _describe(file, file.create_dataset(name, data=values, dtype=kind), dims, units, description)


def _series(
    file: h5py.Group, name: str, shape: tuple[int, ...], kind: Any, dims: tuple[str, ...], units: str, description: str
) -> None:
    chunks = (1, *shape) if shape else (1024,)
    dataset = file.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape), chunks=chunks)
    _describe(file, dataset, ("frame", *dims), units, description)


def _describe(file: h5py.Group, dataset: h5py.Dataset, dims: tuple[str, ...], units: str, description: str) -> None:
    if units:
        dataset.attrs["units"] = units
    dataset.attrs["long_name"] = description
    for axis, dim in enumerate(dims):
        dataset.dims[axis].attach_scale(file[dim])
        dataset.dims[axis].label = dim.rpartition("/")[2]
