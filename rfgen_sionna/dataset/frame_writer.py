"""Frames of one radar, appended to the group of its run in an open file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna.dataset.adc_words import encoded
from rfgen_sionna.dataset.hdf5_layout import create_label, create_pir, create_run
from rfgen_sionna.dataset.run_storage import PLAIN, Storage
from rfgen_sionna.dataset.schema import PIR_CHANNELS, ActorInfo, RunInfo, StoredArray
from rfgen_sionna.dataset.stored_arrays import add_array, append_array
from rfgen_sionna.records import Pir


class FrameWriter:
    """Writer of the frames of one radar into `group`, which is empty, or holds the first frames of the same run."""

    def __init__(self, group: h5py.Group, info: RunInfo, storage: Storage = PLAIN) -> None:
        self.info, self.storage = info, storage
        self._group = group
        self._view: tuple[tuple[float, ...], str] | None = None
        if "frame" not in group:
            create_run(group, info, storage)
        self.frames = int(group["frame"].shape[0])
        if "image" in group.get("pir", ()):
            self._view = (tuple(map(float, group["pir"].attrs["fov_deg"])), str(group["pir"].attrs["projection"]))

    @property
    def group(self) -> h5py.Group:
        """Group of the run in the open file."""
        return self._opened

    @property
    def full_scale(self) -> float | None:
        """Largest I or Q of the ADC in the frames so far [sqrt(W)]; None without frames or quantisation."""
        value = self._quantised.get("full_scale")
        return None if value is None else float(value)

    @property
    def _quantised(self) -> h5py.AttributeManager:
        """Attributes on the ADC: those of the samples, or of their times where no samples are stored."""
        return self._opened["adc" if "adc" in self._opened else "frame_time"].attrs

    def add_array(self, path: str, values: ArrayLike, declared: StoredArray) -> None:
        """Store an array that has no value for each frame; the arguments are those of `RunWriter.add_array`."""
        add_array(self._opened, path, values, declared, self.storage)

    def append(
        self,
        adc: ArrayLike | None,
        *,
        time: float,
        pir: Pir | None = None,
        vertices: Mapping[str, ArrayLike] | None = None,
        joints: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Any] | None = None,
        mesh_time: float | None = None,
        full_scale: float | None = None,
        clipped: float = 0.0,
        arrays: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        """Append a frame; the arguments are those of :meth:`rfgen_sionna.dataset.RunWriter.append`."""
        group = self._opened
        if not np.isfinite(time):
            raise ValueError(f"time is {time!r}: seconds are needed")
        if self.frames and not time > group["frame_time"][self.frames - 1]:
            last = group["frame_time"][self.frames - 1]
            raise ValueError(f"time is {time} s; frames ascend, the last began at {last} s")
        known = self.full_scale if self.frames else full_scale
        if known != full_scale or not 0 <= clipped <= 1 or (full_scale is not None and not 0 < full_scale < np.inf):
            raise ValueError(
                f"full_scale is {full_scale!r} and clipped {clipped!r}: full_scale of the frames before ({known!r}) "
                "and a share in 0 … 1 are needed"
            )
        samples = self._samples(adc, full_scale) if "adc" in group else None
        rows: list[tuple[str, Any]] = [] if samples is None else [("adc", samples)]
        rows += [("frame_time", time), ("mesh_time", time if mesh_time is None else mesh_time)]
        if self.storage.stores("vertices"):
            rows += self._geometry("vertices", vertices, [(a, a.num_vertices) for a in self.info.actors])
        if self.storage.stores("joints"):
            wanted = [(a, len(a.joint_names)) for a in self.info.actors if a.joint_names]
            rows += self._geometry("joints", joints, wanted)
        rows += self._label_rows(labels) if self.storage.stores("labels") else []
        rows += self._pir_rows(pir)
        if set(arrays or {}) != set(self.info.arrays):
            raise ValueError(f"arrays are {sorted(arrays or {})}; declared are {sorted(self.info.arrays)}")
        for path, value in (arrays or {}).items():
            append_array(group, path, value, self.info.arrays[path], self.frames, self.storage)
        # The frame's number comes last: a frame that was cut short is none.
        for name, row in (*rows, ("frame", self.frames)):
            dataset = group[name]
            dataset.resize(self.frames + 1, axis=0)
            dataset[self.frames] = row
        if full_scale is not None:
            words = (1 if self.info.radar.adc.real else 2) * int(np.prod(self.info.radar.frame_shape))
            count = int(self._quantised.get("clipped", 0)) + round(words * clipped)
            self._quantised.update({"full_scale": full_scale, "clipped": count})
        self.frames += 1

    def _samples(self, adc: ArrayLike | None, full_scale: float | None) -> NDArray[Any]:
        """Samples of the frame as they are stored."""
        real, shape = self.info.radar.adc.real, self.info.radar.frame_shape
        samples = np.asarray(adc)
        if samples.shape != shape or samples.dtype.kind != ("f" if real else "c"):
            raise ValueError(
                f"adc is {samples.dtype} {samples.shape}; {'real' if real else 'complex'} {shape} (chirp, tx, rx, "
                "sample) is needed by the radar"
            )
        if not np.all(np.isfinite(samples)):
            raise ValueError(f"adc of frame {self.frames} holds NaN or infinite samples")
        stored = self._opened["adc"]
        if stored.dtype.kind != "i":
            return samples
        if full_scale is None:
            raise ValueError("full_scale is None: the ADC's words need the full scale of the samples")
        bits = int(stored.attrs["bits"])
        step = full_scale / 2 ** (bits - 1)
        words = encoded(samples, step, bits)
        stored.attrs["scale_factor"] = step
        return words

    def _geometry(
        self, kind: str, given: Mapping[str, ArrayLike] | None, wanted: Sequence[tuple[ActorInfo, int]]
    ) -> list[tuple[str, Any]]:
        given = given or {}
        names = {actor.name for actor, _ in wanted}
        if set(given) != names:
            raise ValueError(f"{kind} are given for {sorted(given)}; needed for {sorted(names)}")
        rows = []
        for actor, count in wanted:
            array = np.asarray(given[actor.name], np.float64)
            if array.shape != (count, 3) or not np.all(np.isfinite(array)):
                raise ValueError(f"{kind} of '{actor.name}' have shape {array.shape}: finite ({count}, 3) is needed")
            rows.append((f"actors/{actor.name}/{kind}", array))
        return rows

    def _label_rows(self, labels: Mapping[str, Any] | None) -> list[tuple[str, Any]]:
        labels = labels or {}
        if set(labels) != set(self.info.labels):
            raise ValueError(f"labels are {sorted(labels)}; declared are {sorted(self.info.labels)}")
        group, rows = self._opened["labels"], []
        for name, label in self.info.labels.items():
            value = np.asarray(labels[name], object if label.text else np.float64)
            if label.text and not all(isinstance(item, str) for item in value.flat):
                raise ValueError(f"label '{name}' is {labels[name]!r}: texts are needed")
            if name not in group:
                create_label(self._opened, name, label, value.shape)
            if value.shape != group[name].shape[1:]:
                raise ValueError(
                    f"label '{name}' has shape {value.shape}; {group[name].shape[1:]} {label.dims} is needed"
                )
            rows.append((f"labels/{name}", value if value.ndim else value.item()))
        return rows

    def _pir_rows(self, pir: Pir | None) -> list[tuple[str, Any]]:
        exists = "image" in self._opened.get("pir", ())
        if pir is None:
            if exists:
                raise ValueError(f"pir is missing in frame {self.frames}; the frames before have one")
            return []
        if not exists:
            if self.frames:
                raise ValueError(f"pir is given in frame {self.frames}; the frames before have none")
            create_pir(self._opened, pir, self.storage)
            self._view = (tuple(pir.fov_deg), pir.projection)
        image = np.stack([getattr(pir, channel) for channel in PIR_CHANNELS]).astype(np.float32)
        if image.shape != self._opened["pir/image"].shape[1:] or self._view != (tuple(pir.fov_deg), pir.projection):
            raise ValueError(
                f"pir of frame {self.frames} has {image.shape[1:]} pixels, {pir.fov_deg} degrees, {pir.projection}; "
                f"{self._opened['pir/image'].shape[2:]}, {self._view} as in the first frame are needed"
            )
        return [
            ("pir/image", image),
            ("pir/time", pir.time),
            ("pir/position", pir.position),
            ("pir/orientation", pir.orientation),
        ]

    @property
    def _opened(self) -> h5py.Group:
        if not self._group:
            raise RuntimeError("the writer is closed; append frames inside its 'with' block")
        return self._group
