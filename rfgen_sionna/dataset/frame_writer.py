"""Frames of one radar, appended to the group of its run in an open file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.dataset.hdf5_layout import create_label, create_pir, create_run
from rfgen_sionna.dataset.schema import PIR_CHANNELS, ActorInfo, RunInfo
from rfgen_sionna.records import Pir


class FrameWriter:
    """Writer of the frames of one radar into `group`, which is empty, or holds the first frames of the same run."""

    def __init__(self, group: h5py.Group, info: RunInfo) -> None:
        self.info = info
        self._group = group
        self._view: tuple[tuple[float, ...], str] | None = None
        if "adc" not in group:
            create_run(group, info)
        self.frames = int(group["frame"].shape[0])
        if "image" in group.get("pir", ()):
            self._view = (tuple(map(float, group["pir"].attrs["fov_deg"])), str(group["pir"].attrs["projection"]))

    @property
    def full_scale(self) -> float | None:
        """Largest I or Q of the ADC in the frames so far [sqrt(W)]; None without frames or quantisation."""
        value = self._opened["adc"].attrs.get("full_scale")
        return None if value is None else float(value)

    def append(
        self,
        adc: ArrayLike,
        *,
        time: float,
        pir: Pir | None = None,
        vertices: Mapping[str, ArrayLike] | None = None,
        joints: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Any] | None = None,
        mesh_time: float | None = None,
        full_scale: float | None = None,
        clipped: float = 0.0,
    ) -> None:
        """Append a frame; the arguments are those of :meth:`rfgen_sionna.dataset.RunWriter.append`."""
        group = self._opened
        samples, shape = np.asarray(adc), group["adc"].shape[1:]
        kind, number = ("f", "real") if self.info.radar.adc.real else ("c", "complex")
        if samples.shape != shape or samples.dtype.kind != kind:
            raise ValueError(
                f"adc is {samples.dtype} {samples.shape}; {number} {shape} (chirp, tx, rx, sample) is needed by the "
                "radar"
            )
        if not np.all(np.isfinite(samples)):
            raise ValueError(f"adc of frame {self.frames} holds NaN or infinite samples")
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
        rows: list[tuple[str, Any]] = [
            ("adc", samples),
            ("frame_time", time),
            ("mesh_time", time if mesh_time is None else mesh_time),
        ]
        rows += self._geometry("vertices", vertices, [(a, a.num_vertices) for a in self.info.actors])
        rows += self._geometry("joints", joints, [(a, len(a.joint_names)) for a in self.info.actors if a.joint_names])
        rows += self._label_rows(labels)
        rows += self._pir_rows(pir)
        # The frame's number comes last: a frame that was cut short is none.
        for name, value in (*rows, ("frame", self.frames)):
            dataset = group[name]
            dataset.resize(self.frames + 1, axis=0)
            dataset[self.frames] = value
        if full_scale is not None:
            words = (1 if kind == "f" else 2) * samples.size
            count = int(group["adc"].attrs.get("clipped", 0)) + round(words * clipped)
            group["adc"].attrs.update({"full_scale": full_scale, "clipped": count})
        self.frames += 1

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
            create_pir(self._opened, pir)
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
