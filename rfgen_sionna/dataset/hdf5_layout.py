"""Datasets, axes and attributes of a run file, as :mod:`rfgen_sionna.dataset.schema` describes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import h5py
import numpy as np

from rfgen_sionna.dataset.run_storage import PLAIN, Storage
from rfgen_sionna.dataset.schema import AXES, FORMAT, PIR_CHANNELS, RADARS, VERSION, ActorInfo, Label, RunInfo
from rfgen_sionna.records import Pir

FAR = 1e3
"""Coordinate of a radar [m] beyond which meshes are stored as float64: float32 numbers are 0.06 mm apart."""
_TEXT = h5py.string_dtype()


def _heading(storage: Storage, recording: Mapping[str, Any] | None) -> dict[str, str]:
    """Attributes of every file."""
    found = {"Conventions": f"{FORMAT}-{VERSION}", "format": FORMAT, "format_version": VERSION}
    if storage.dated:
        found["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    if storage.keep is not None:
        found["contents"] = json.dumps(sorted(storage.keep))
    if recording is not None:
        found["recording"] = json.dumps(dict(recording), sort_keys=True)
    return found


def _settings(info: RunInfo) -> dict[str, str]:
    """Attributes that determine the frames of a run."""
    return {
        "prompt": info.prompt, "negative_prompt": info.negative_prompt, "environment": info.environment,
        "receiver": "" if info.receiver is None else json.dumps(info.receiver),
        "radar": json.dumps(info.radar.to_dict()),
        "seeds": json.dumps({name: None if seed is None else int(seed) for name, seed in info.seeds.items()}),
        "settings": json.dumps(dict(info.settings)),
    }  # fmt: skip


def create_radars(file: h5py.File, infos: Mapping[str, RunInfo], storage: Storage) -> None:
    """Create a file for several radars, each with a group for its run."""
    recording = next(iter(infos.values())).recording
    file.attrs.update(_heading(storage, recording) | {RADARS: json.dumps(list(infos))})
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


def create_run(file: h5py.Group, info: RunInfo, storage: Storage) -> None:
    """Create everything but labels, PIR and further arrays, whose shapes are those of the first frame."""
    radar, wave = info.radar, info.radar.waveform
    software = {"report": info.report, "software": json.dumps(dict(info.software))}
    file.attrs.update(_heading(storage, info.recording) | _settings(info) | software)
    create_scale(file, "frame", np.arange(0), "frame number", frames=True)
    create_scale(file, "chirp", np.arange(wave.num_loops), "loop within the frame")
    by_element = radar.axis_names == radar.tx_names
    create_scale(
        file, "tx", list(radar.axis_names), "transmit element" if by_element else "slot, with its active elements"
    )
    create_scale(file, "rx", list(radar.rx_names), "receive element")
    create_scale(file, "sample", np.arange(wave.num_samples), "ADC sample within the chirp")
    if storage.stores("adc"):
        _create_samples(file, info, storage)
    create_series(file, "frame_time", (), np.float64, (), "s", "start of the first ramp of the frame")
    create_series(file, "mesh_time", (), np.float64, (), "s", "time of meshes, joints and labels")
    create_fixed(file, "chirp_time", wave.chirp_times, ("chirp", "tx"), "s", "start of the ramp in the frame")
    if wave.other_profiles:
        times = [wave.profiles[wave.slots[slot].profile].sample_times(wave.num_samples) for slot in wave.axis_slots]
        create_fixed(file, "sample_time", np.stack(times), ("tx", "sample"), "s", "time after the start of the ramp")
    else:
        create_fixed(file, "sample_time", wave.sample_times, ("sample",), "s", "time after the start of the ramp")
    create_scale(file, "axis", list(AXES), "component in the world frame")
    if not by_element:
        create_scale(file, "tx_element", list(radar.tx_names), "transmit element")
        phases = np.stack([slot.phases(1, wave.phase_step_deg)[0] for slot in wave.slots])
        create_fixed(
            file, "tx_phase", phases, ("tx", "tx_element"), "degree", "phase in the first loop; NaN where it is off"
        )
        advance = np.array([slot.advance_deg or (0.0,) * wave.num_tx for slot in wave.slots])
        create_fixed(
            file, "tx_advance", advance, ("tx", "tx_element"), "degree", "growth of that phase from loop to loop"
        )
    place = ("tx" if by_element else "tx_element", "axis")
    create_fixed(file, "tx_position", radar.tx_positions, place, "m", "element position, device frame")
    create_fixed(file, "rx_position", radar.rx_positions, ("rx", "axis"), "m", "element position, device frame")
    file.create_group("labels")
    file.create_group("actors")
    if info.actors:
        create_scale(file, "actor", [actor.name for actor in info.actors], "name of the actor")
    far = np.abs(radar.position).max() > FAR
    for actor in info.actors:
        _create_actor(file, actor, np.float64 if far else np.float32, storage)


def _create_samples(file: h5py.Group, info: RunInfo, storage: Storage) -> None:
    radar = info.radar
    meaning = "real samples" if radar.adc.real else "complex baseband"
    meaning = f"{meaning} at the receiver input: |sample|² is power"
    shape: tuple[int, ...] = radar.frame_shape
    kind: np.dtype[Any] = np.dtype(radar.sample_type)
    dims: tuple[str, ...] = ("chirp", "tx", "rx", "sample")
    if bits := storage.word_bits(info):
        shape, kind = (shape, np.dtype(np.int16)) if radar.adc.real else ((*shape, 2), np.dtype(np.int16))
        if not radar.adc.real:
            create_scale(file, "iq", ["I", "Q"], "in-phase or quadrature")
            dims = (*dims, "iq")
        meaning += "; stored are the words of the ADC"
    create_series(file, "adc", shape, kind, dims, "sqrt(W)", meaning, storage)
    if bits:
        file["adc"].attrs["bits"] = bits


def _create_actor(file: h5py.Group, actor: ActorInfo, number: type[np.floating[Any]], storage: Storage) -> None:
    at = f"actors/{actor.name}"
    file.create_group(at).attrs["material"] = actor.material
    if storage.stores("vertices"):
        _create_mesh(file, actor, number, storage)
    if actor.joint_names and storage.stores("joints"):
        create_scale(file, f"{at}/joint", list(actor.joint_names), "name of the joint")
        create_series(
            file, f"{at}/joints", (len(actor.joint_names), 3), number, (f"{at}/joint", "axis"), "m",
            "joint position, world frame", storage,
        )  # fmt: skip


def _create_mesh(file: h5py.Group, actor: ActorInfo, number: type[np.floating[Any]], storage: Storage) -> None:
    at = f"actors/{actor.name}"
    create_scale(file, f"{at}/vertex", np.arange(actor.num_vertices, dtype=np.int32), "vertex number", storage)
    create_scale(file, f"{at}/face", np.arange(len(actor.faces), dtype=np.int32), "face number", storage)
    create_scale(file, f"{at}/corner", np.arange(3, dtype=np.int32), "corner of the face")
    create_scale(file, f"{at}/part", list(actor.part_names), "name of the body part")
    face, corner = f"{at}/face", f"{at}/corner"
    text = "vertex numbers, counter-clockwise from outside"
    create_fixed(file, f"{at}/faces", actor.faces, (face, corner), "", text, storage)
    create_fixed(file, f"{at}/face_part", actor.face_parts, (face,), "", "index into part", storage)
    create_series(
        file, f"{at}/vertices", (actor.num_vertices, 3), number, (f"{at}/vertex", "axis"), "m",
        "vertex position, world frame", storage,
    )  # fmt: skip


def create_label(file: h5py.Group, name: str, label: Label, shape: tuple[int, ...]) -> None:
    """Create the series of a label with values of `shape`; ValueError if it has other axes than declared."""
    if len(shape) != len(label.dims):
        raise ValueError(f"label '{name}' has shape {shape}; the axes {label.dims} are declared")
    dims = []
    for dim, length in zip(label.dims, shape, strict=True):
        at = dim if dim in file and file[dim].is_scale else f"labels/{dim}"
        if at not in file:
            create_scale(file, at, np.arange(length), dim)
        if file[at].shape != (length,):
            raise ValueError(f"label '{name}' has shape {shape}; '{dim}' has {file[at].shape[0]} entries")
        dims.append(at)
    kind = _TEXT if label.text else np.float64
    create_series(file, f"labels/{name}", shape, kind, tuple(dims), label.units, label.description)


def create_pir(file: h5py.Group, pir: Pir, storage: Storage) -> None:
    """Create the series of images with the pixels, field of view and projection of `pir`."""
    rows, columns = np.shape(pir.energy)
    file.create_group("pir").attrs.update({"fov_deg": pir.fov_deg, "projection": pir.projection})
    create_scale(file, "pir/channel", list(PIR_CHANNELS), "quantity")
    create_scale(file, "pir/row", np.arange(rows), "0 is the top")
    create_scale(file, "pir/column", np.arange(columns), "0 is the left side seen from the radar")
    create_fixed(file, "pir/channel_units", list(PIR_CHANNELS.values()), ("pir/channel",), "", "units of each channel")
    create_series(
        file, "pir/image", (len(PIR_CHANNELS), rows, columns), np.float32, ("pir/channel", "pir/row", "pir/column"),
        "see channel_units", "energy is |path gain|² of isotropic elements", storage,
    )  # fmt: skip
    create_series(file, "pir/time", (), np.float64, (), "s", "time of the image")
    create_series(file, "pir/position", (3,), np.float64, ("axis",), "m", "viewpoint, world frame")
    create_scale(file, "pir/angle", ["yaw", "pitch", "roll"], "rotation")
    create_series(file, "pir/orientation", (3,), np.float64, ("pir/angle",), "rad", "orientation of the viewpoint")


def create_scale(
    file: h5py.Group, name: str, values: Any, description: str, storage: Storage = PLAIN, *, frames: bool = False,
) -> None:  # fmt: skip
    """Create an axis with its values, a list of texts or an array; it grows with the run if `frames`."""
    text = isinstance(values, list)
    more: dict[str, Any] = {"maxshape": (None,), "chunks": (1024,)} if frames else {}
    if not text and not frames:
        more = storage.filters(np.shape(values), np.asarray(values).dtype)
    dataset = file.create_dataset(name, data=values, dtype=_TEXT if text else None, **more)
    dataset.attrs["long_name"] = description
    dataset.make_scale(name.rpartition("/")[2])


def create_fixed(
    file: h5py.Group, name: str, values: Any, dims: tuple[str, ...], units: str, description: str,
    storage: Storage = PLAIN,
) -> None:  # fmt: skip
    """Create an array that has no frames, with the paths of its axes."""
    if isinstance(values, list):
        dataset = file.create_dataset(name, data=values, dtype=_TEXT)
    else:
        dataset = file.create_dataset(name, data=values, **storage.filters(values.shape, values.dtype))
    describe(file, dataset, dims, units, description)


def create_series(
    file: h5py.Group, name: str, shape: tuple[int, ...], kind: Any, dims: tuple[str, ...], units: str,
    description: str, storage: Storage = PLAIN,
) -> None:  # fmt: skip
    """Create an array with a value of `shape` for each frame, none so far, and the paths of the value's axes."""
    chunks = (1, *shape) if shape else (1024,)
    more = {"chunks": chunks} | storage.filters(chunks, np.dtype(kind))
    dataset = file.create_dataset(name, (0, *shape), kind, maxshape=(None, *shape), **more)
    describe(file, dataset, ("frame", *dims), units, description)


def describe(file: h5py.Group, dataset: h5py.Dataset, dims: tuple[str, ...], units: str, description: str) -> None:
    """Give a dataset its unit, its description and the paths of its axes."""
    if units:
        dataset.attrs["units"] = units
    dataset.attrs["long_name"] = description
    for axis, dim in enumerate(dims):
        dataset.dims[axis].attach_scale(file[dim])
        dataset.dims[axis].label = dim.rpartition("/")[2]
