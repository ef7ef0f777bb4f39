"""Actors of a scene from prompts, motions and mesh files."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.generative.bodies import (
    BodySequence,
    Phenotype,
    PhenotypeError,
    Rig,
    VitalSigns,
    animate,
    describe,
    person,
)
from rfgen_sionna.generative.bodies.gltf import is_animated, load_animation
from rfgen_sionna.generative.bodies.measured_person import JointResidual, measured_person
from rfgen_sionna.generative.bodies.sampled import mesh_sequence
from rfgen_sionna.generative.decisions import Decision
from rfgen_sionna.generative.driving import Drive
from rfgen_sionna.generative.motion import MotionSource
from rfgen_sionna.generative.motion.importers import MOTION_SUFFIXES, load_any_motion
from rfgen_sionna.generative.motion.joint_recording import record_joints
from rfgen_sionna.generative.motion.joint_smoothing import LONGEST_GAP
from rfgen_sionna.generative.motion_sources import check_source, motion_source, performed_motion
from rfgen_sionna.generative.person_decisions import (
    material_decision,
    motion_decision,
    prompt_decisions,
    vital_signs_of,
)
from rfgen_sionna.generative.prompts import DEFAULT_DISTANCE, ScenePrompt, check_seed
from rfgen_sionna.generative.prompts.prompt_reader import read_prompt
from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt
from rfgen_sionna.generative.radar_placement import distance_for_way, place_before_radar, way_decisions
from rfgen_sionna.generative.things.prompted_thing import prompted_thing
from rfgen_sionna.generative.things.thing_placement import Thing, named_thing
from rfgen_sionna.radar.pose import rotation_matrix
from rfgen_sionna.records import MeshSequence, Motion
from rfgen_sionna.scene.mesh_actor import MeshActor

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_LOG = logging.getLogger(__name__)

DEFAULT_DURATION = 3.0
"""Default duration of a motion [s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Actor(MeshActor):
    """A :class:`rfgen_sionna.scene.MeshActor` from a prompt, a motion or a file."""

    motion: Motion | None = None
    """Motion of an actor with a skeleton."""
    prompt: ScenePrompt | None = None
    """Interpreted prompt."""
    body: Rig | None = None
    """Body of a person."""
    phenotype: Phenotype | None = None
    """Given attributes of the body; the seed drew the rest."""
    decisions: tuple[Decision, ...] = ()
    """Decisions of an actor from a prompt, each with its origin: prompt, argument, default or seed."""
    residual: JointResidual | None = None
    """Distances of the body's joints from those that it was made from, of an actor from joints."""
    thing_record: Thing | None = None
    """Kind, action and parameters of an animal or a thing."""
    named_action: str = ""
    """Action in the labels, in place of that of prompt, thing or motion."""

    @property
    def action(self) -> str:
        """Action of the prompt, the thing, or a motion by this package's sources; "clip: NAME" for another one."""
        if self.named_action:
            return self.named_action
        if self.thing_record is not None:
            return self.thing_record.action
        if self.prompt is not None:
            return self.prompt.action
        if self.motion is None or not self.motion.action:
            return ""
        return self.motion.action if self.motion.seed is not None else f"clip: {self.motion.action}"

    def report(self, more: Iterable[Decision] = ()) -> str:
        """Interpretation of the prompt and every decision with its origin, `more` at the end; of an actor from joints,
        the residual of each joint; several lines.

        Raises:
            ValueError: the actor is from neither a prompt nor joints.
        """
        if self.residual is not None:
            return str(self.residual)
        if self.prompt is None:
            raise ValueError(f"actor '{self.name}' has no prompt and no report; Actor.from_prompt makes one")
        return self.prompt.report((*self.decisions, *more))

    @property
    def vital_signs(self) -> VitalSigns | None:
        """Breathing and heartbeat of a person; None for a still skin."""
        return getattr(self.sequence, "vital_signs", None)

    def with_vital_signs(self, vital_signs: VitalSigns | None) -> Self:
        """The same person with breathing and heartbeat, from a prompt, a clip or joints.

        Raises:
            ValueError: the actor's mesh is no body of this package.
        """
        if not isinstance(self.sequence, BodySequence):
            raise ValueError(f"actor '{self.name}' is a {type(self.sequence).__name__}, no body with a chest")
        return replace(self, sequence=replace(self.sequence, vital_signs=vital_signs))

    @classmethod
    def from_prompt(
        cls,
        prompt: str | ScenePrompt,
        *,
        seed: int = 0,
        duration: float = DEFAULT_DURATION,
        body: Rig | Phenotype | None = None,
        position: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        negative: str = "",
        material: str = "skin",
        name: str = "person",
        radar: Radar | None = None,
        source: MotionSource | None = None,
        floor: float = 0.0,
        motion: str = "auto",
        body_seed: int | None = None,
    ) -> Actor:
        """Person, animal or thing from a prompt.

        Args:
            prompt: a sentence or keywords, such as "a tall woman walking back and forth, at 4 m", or an interpreted
                prompt, whose warnings are then not logged again.
            seed: seed of all open choices.
            duration: duration of the motion [s].
            body: the body; a phenotype is completed from the seed, None takes the prompt's attributes, of a person.
            position: world position of the motion's origin [m]; None takes the prompt's distance (default 3 m) and
                azimuth in front of the radar, at the height `floor`.
            orientation: (yaw, pitch, roll) [rad]; None faces the radar, turned by the prompt's angle.
            negative: negative prompt.
            material: name of a material.
            name: name of the person in labels.
            radar: the radar; None is one at the origin with its boresight along +x.
            source: source of the motion; None takes the one named by `motion`.
            floor: height of the floor under the person [m].
            motion: "auto" (clips of the motion library, and rules for what no clip has), "kinematic" (rules alone) or
                "diffusion" (auto, varied by the learned model).
            body_seed: seed of the body, or of the size of an animal or thing; None is `seed`.

        Raises:
            PromptError: the prompt cannot be carried out.
            PhenotypeError: the attributes of the body are out of reach.
            ValueError: a duration, speed or hand out of the source's range, or a walk too near the radar.
            ImportError: anny (or torch), or for the learned model diffusers, is not installed.
        """
        check_seed(seed)
        source = source or motion_source("auto" if isinstance(prompt, ThingPrompt) else motion)
        if isinstance(prompt, ScenePrompt):
            said = prompt
        else:
            said = read_prompt(prompt, negative, seed=seed, body_seed=body_seed)
            for sentence in said.warnings:
                _LOG.warning(sentence)
        body_seed = seed if body_seed is None else body_seed
        if isinstance(said, ThingPrompt):
            given = {"position": position, "orientation": orientation, "body": body, "material": material}
            return cls(**prompted_thing(said, given, seed, duration, radar, floor, name, body_seed))
        words = said.body
        wanted = Phenotype(words.gender, words.age_years, words.height_m, words.weight_kg, words.muscle)
        phenotype = body if isinstance(body, Phenotype) else wanted if body is None else None
        distance = DEFAULT_DISTANCE if said.distance_m is None else said.distance_m
        place, yaw = (0.0, 0.0), 0.0
        if position is None or orientation is None:
            place, yaw = place_before_radar(radar, distance, said.bearing_deg or 0.0)
        yaw += np.radians(said.orientation_deg or 0.0)
        # before the body, whose first construction may take a minute
        check_source(said, duration, source)
        if isinstance(body, Rig):
            rig = body
        else:
            try:
                rig = person(phenotype, seed=body_seed)
            except PhenotypeError:
                # Attributes by words contradict each other: drop the muscles.
                if phenotype is not wanted or not {"weight", "muscle"} <= words.drawn:
                    raise
                muscle, weight = words.muscle, words.weight_kg
                _LOG.warning("body: muscle %g is out of reach at %g kg; the weight is kept", muscle, weight)
                phenotype = replace(wanted, muscle=None)
                rig = person(phenotype, seed=body_seed)
        performed = performed_motion(said, duration, seed, rig.skeleton, source)
        free = position is None and orientation is None
        if free and said.distance_m is None:
            distance = distance_for_way(performed, np.radians(said.orientation_deg or 0.0), DEFAULT_DISTANCE)
            place, _ = place_before_radar(radar, distance, said.bearing_deg or 0.0)
            if distance > DEFAULT_DISTANCE:
                said = replace(said, distance_m=distance, origins={**said.origins, "distance": "room for the way"})
        way = way_decisions(said, performed, place if free else None, yaw, radar)
        arguments = {"position": position, "orientation": orientation, "body": body}
        return cls(
            animate(rig, performed, vital_signs_of(said, seed)), material, name=name,
            position=cast(Any, (*place, floor) if position is None else position),
            orientation=cast(Any, (yaw, 0.0, 0.0) if orientation is None else orientation),
            motion=replace(performed, prompt=said.text), prompt=said, body=rig, phenotype=phenotype,
            decisions=(
                *prompt_decisions(said, body_seed, describe(rig), arguments), *way, motion_decision(source, performed),
                material_decision(material),
            ),
        )  # fmt: skip

    @classmethod
    def thing(
        cls,
        kind: str,
        *,
        action: str | None = None,
        seed: int = 0,
        speed: float | None = None,
        path: ArrayLike | Drive | None = None,
        position: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        name: str | None = None,
        radar: Radar | None = None,
        **parameters: float,
    ) -> Actor:
        """Animal or thing by its name: "dog", "car", "drone", "door", ... (:func:`rfgen_sionna.things` lists them).

        Args:
            kind: name of a kind.
            action: one of its actions; None takes its first.
            seed: seed of size and details.
            speed: speed of an action that moves [m/s], straight ahead; None takes the usual one.
            path: points (point, 2) or (point, 3) [m] of its way, from standstill to standstill, or a
                :class:`~rfgen_sionna.generative.driving.Drive`; it replaces `position` and `orientation`.
            position, orientation, radar: as in :meth:`from_prompt`, without a prompt; None of `position` is at the
                usual height of the action.
            name: name in labels; None takes that of the kind.
            parameters: values of parameters of the kind, such as turns_per_second.

        Raises:
            ValueError: an unknown kind, action or parameter, or a value that is not allowed.
        """
        check_seed(seed)
        return cls(**named_thing(kind, action, seed, speed, path, position, orientation, name, radar, parameters))

    @classmethod
    def from_motion(
        cls,
        motion: Motion | str | PathLike[str],
        *,
        seed: int = 0,
        body: Rig | Phenotype | None = None,
        frame_rate: float | None = None,
        up: str | None = None,
        index: int = 0,
        position: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        material: str = "skin",
        name: str = "person",
        radar: Radar | None = None,
    ) -> Actor:
        """Person with a motion, or actor from a mesh sequence.

        Args:
            motion: a motion; its file (SMPL, SMPL-H or SMPL-X parameters as `.npz`, `.npy`, `.pkl` or `.pt`; MDM's or
                HumanML3D's `.npy`; `.bvh`); a `.glb` file with an animation; or a folder of meshes of fixed
                connectivity.
            seed: seed of the attributes that `body` leaves open.
            body: body of a person; None draws one. Meshes take none.
            frame_rate: poses or meshes per second [Hz], required where a file has none (meshes, videos' parameters);
                it replaces a file's own, with a warning where they differ. Sampling rate of an animation, None takes
                30.
            up: up axis of the file, "z", "y", "-y", ...; None takes the format's own (z for AMASS and meshes, y for
                glTF, MDM and HumanML3D, "-y" for camera frames, of a standing body for `.bvh`).
            index: number of the motion in a file (MDM's `results.npy`, animations of a GLB file), or of the person.
            position, orientation, material, name, radar: as in :meth:`from_prompt`, without a prompt.

        Raises:
            FileNotFoundError: there is no such file or folder.
            ClipError: the file cannot be used.
            ValueError: `frame_rate` is missing, or an argument does not apply to this kind of motion.
        """
        place, yaw = place_before_radar(radar, DEFAULT_DISTANCE)
        sequence: MeshSequence
        rig: Rig | None = None
        phenotype: Phenotype | None = None
        if not isinstance(motion, Motion) and is_animated(motion):
            if body is not None:
                raise ValueError("body: an animated mesh is its own body; leave it out")
            rate = 30.0 if frame_rate is None else frame_rate
            sequence, clip = load_animation(motion, frame_rate=rate, animation=index, up=up), None
        elif not isinstance(motion, Motion) and Path(motion).suffix.lower() not in MOTION_SUFFIXES:
            if body is not None:
                raise ValueError("body: a mesh sequence is its own body; leave it out")
            sequence, clip = mesh_sequence(motion, frame_rate, index, name=name, up=up), None
        else:
            if isinstance(motion, Motion):
                if index or frame_rate is not None or up is not None:
                    raise ValueError(
                        "index, frame_rate and up: a Motion is one, with its own rate and z up; leave them out"
                    )
                clip = motion
            else:
                clip = load_any_motion(motion, up=up, frame_rate=frame_rate, index=index, action=Path(motion).stem)
            phenotype = None if isinstance(body, Rig) else body or Phenotype()
            rig = body if isinstance(body, Rig) else person(phenotype, seed=seed)
            sequence = animate(rig, clip)
        return cls(
            sequence, material, name=name, position=cast(Any, (*place, 0.0) if position is None else position),
            orientation=cast(Any, (yaw, 0.0, 0.0) if orientation is None else orientation), motion=clip, body=rig,
            phenotype=phenotype,
        )  # fmt: skip

    @classmethod
    def from_joints(
        cls,
        positions: ArrayLike | str | PathLike[str],
        *,
        layout: str | None = None,
        names: Sequence[str] | None = None,
        up: str | None = None,
        frame_rate: float | None = None,
        times: ArrayLike | None = None,
        scale: float = 1.0,
        columns: str | None = None,
        index: int | None = None,
        longest_gap: float = LONGEST_GAP,
        body: Rig | Phenotype | None = None,
        seed: int = 0,
        position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = (0.0, 0.0, 0.0),
        floor: float | None = None,
        material: str = "skin",
        name: str = "person",
    ) -> Actor:
        """Person whose joints follow recorded positions, with the recorded bone lengths, where the person was.

        Paths are smoothed by smoothing splines of 1 to 6 Hz chosen by cross-validation. Hips, knees, ankles, shoulders,
        elbows and wrists are needed. `residual` states how far the body's joints are from the smoothed ones.

        Args:
            positions: (frame, joint, 3) [m], NaN where missing; or (frame, joint, 4) with a confidence of 0 to 1 or a
                Kinect's tracking state; or (frame, person, joint, 3); or a file: `.npy`, `.npz` (`positions`, and
                `times` or `frame_rate`, `names`, `confidence`), `.csv` with columns such as `left_knee_x` (and `time`).
            layout: "kinect_v2" (or "kinect25"), "azure_kinect", "kinect_v1", "mediapipe33", "smpl22", "smpl24",
                "coco17", "h36m17" or "body25"; None takes `names` or those of the file.
            names: name of each joint, such as left_hip.
            up: up axis of the data, "z", "y", "-y" (cameras), ...; None takes z, and refuses data of whom stands along
                another axis. With "y" and "-y" the data's z axis (what the camera looks along) becomes the world's x.
            frame_rate: frames per second [Hz]; it replaces a file's own.
            times: (frame,) increasing times [s], also uneven.
            scale: metres per unit of the data, 0.001 for millimetres.
            columns: order of flat columns without names, "xyz" (x, y, z of each joint) or "planar" (all x, all y, ...).
            index: number of the person, or of the motion in MDM's `results.npy`.
            longest_gap: longest time without a joint that is interpolated [s].
            body: body whose bones get the recorded lengths; None draws an adult of the recorded stature.
            seed: seed of the attributes that `body` leaves open.
            position: world position of the data's origin [m], such as that of the camera.
            orientation: (yaw, pitch, roll) of the data's axes in the world [rad], after `up`.
            floor: height at which the feet stand [m]; None leaves them where they were recorded.
            material: name of a material.
            name: name of the person in labels.

        Raises:
            FileNotFoundError: there is no such file.
            ClipError: positions, names, axis, unit or times are missing or wrong; the message names the cure.
            PhenotypeError: the attributes of `body` are out of reach.
            ImportError: anny (or torch) is not installed.
        """
        recording = record_joints(
            positions, layout=layout, names=names, columns=columns, index=index, up=up, scale=scale,
            frame_rate=frame_rate, times=times, longest_gap=longest_gap,
        )  # fmt: skip
        action = Path(positions).stem if isinstance(positions, (str, PathLike)) else ""
        measured = measured_person(recording, body=body, seed=seed, action=action)
        turn = rotation_matrix(orientation)
        place = np.asarray(position, np.float64) + turn[:, 2] * measured.floor
        if floor is not None:
            place[2] = floor
        return cls(
            measured.sequence, material, name=name, position=cast(Any, tuple(place)),
            orientation=cast(Any, orientation), motion=measured.motion, body=measured.sequence.rig,
            phenotype=body if isinstance(body, Phenotype) else None, residual=measured.residual,
        )  # fmt: skip
