"""What a run of other samples takes from the recorded one, as it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import ActorInfo, Label, Run, RunInfo, RunWriter
from rfgen_sionna.dataset.representations import KEPT, REPRESENTATIONS, representation_arrays
from rfgen_sionna.radar import Radar
from rfgen_sionna.resynthesis.path_samples import Resynthesis


class CopiedContents:
    """Meshes, bodies, joints, labels and images of a run, for another one of a `radar` with what `keep` names."""

    def __init__(self, run: Run, keep: tuple[str, ...], radar: Radar) -> None:
        self._run, self._keep, self._radar = run, keep, radar
        computed = {KEPT[name].dataset for name in REPRESENTATIONS}
        declared = {path: array for path, array in run.arrays.items() if path not in computed}
        if "body" not in keep:
            declared = {path: array for path, array in declared.items() if "/body/" not in path}
        of_frames = [path for path in declared if self._dims(path)[:1] == ("frame",) or declared[path].ragged]
        self._arrays = {path: declared[path] for path in of_frames}
        self._constants = {path: array for path, array in declared.items() if path not in of_frames}
        self._labels = run.labels if "labels" in keep else {}
        self._other_window = "in_range" in self._labels and radar.max_range != run.radar.max_range
        for name in run.actors if self._other_window else ():
            self._share_in_range(name, 0)  # needs its mesh

    def _dims(self, path: str) -> tuple[str, ...]:
        stored: Any = self._run.stored(path)
        return tuple(dim.label for dim in stored.dims)

    def info(
        self, made: Resynthesis, receiver: Mapping[str, Any], seed: int, recording: Mapping[str, Any] | None
    ) -> RunInfo:
        """Properties of the new run."""
        run = self._run
        settings = run.settings | {"frames": len(made.frames), "keep": list(self._keep)}
        if made.radar != run.radar:
            settings["traced"] = f"{run.radar.name}, {run.radar.preset}"
        return RunInfo(
            made.radar, run.prompt, run.negative_prompt, run.environment, run.seeds | {"noise": seed},
            tuple(map(self._actor, run.actors)),
            {
                name: Label(label.units, label.dims[1:], label.description, label.values.dtype.kind == "O")
                for name, label in self._labels.items()
            },
            run.report, receiver, settings, run.software,
            {**self._arrays, **representation_arrays(self._keep, made.radar)},
            (run.recording or None) if recording is None else recording,
        )  # fmt: skip

    def _actor(self, name: str) -> ActorInfo:
        actor = self._run.actors[name]
        if "vertices" not in self._keep:
            return ActorInfo(name, actor.material, np.empty((0, 3), np.int32), 0, joint_names=actor.joint_names)
        vertices = len(actor.vertices(0))
        return ActorInfo(
            name, actor.material, actor.faces, vertices, actor.part_names, actor.face_parts, actor.joint_names
        )  # fmt: skip

    def constants(self, writer: RunWriter, radar: str) -> None:
        """Write the arrays without frames, and the records of bodies."""
        for name in self._run.actors if "body" in self._keep else ():
            path = f"actors/{name}/body"
            recorded: Any = self._run.stored(path)
            writer.radar(radar).group.require_group(path).attrs.update(recorded.attrs)
        for path, array in self._constants.items():
            values: Any = self._run.array(path)
            writer.add_array(path, values, array, radar=radar)

    def frame(self, number: int) -> dict[str, Any]:
        """Arguments of :meth:`rfgen_sionna.dataset.RunWriter.append` from frame `number`, but samples and its time."""
        run, actors = self._run, self._run.actors
        labels = {name: label.values[number] for name, label in self._labels.items()}
        if self._other_window:
            labels["in_range"] = np.array([self._share_in_range(each, number) for each in actors])
        joints = {name: each.joints(number) for name, each in actors.items() if each.joint_names}
        return {
            "pir": run.pir(number) if "pir" in self._keep else None,
            "mesh_time": float(run.mesh_times[number]),
            "vertices": {name: each.vertices(number) for name, each in actors.items()}
            if "vertices" in self._keep
            else {},
            "joints": joints if "joints" in self._keep else {},
            "labels": labels,
            "arrays": {path: run.array(path, number) for path in self._arrays},
        }

    def _share_in_range(self, actor: str, number: int) -> float:
        """Share of the vertices of an actor within the range window."""
        place: FloatArray = np.asarray(self._radar.at(float(self._run.mesh_times[number])).position)
        away = np.linalg.norm(self._run.actors[actor].vertices(number) - place, axis=1)
        return float((away <= self._radar.max_range).mean())
