"""People, and whatever else a file holds, as actors of a scene."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.generative.bodies import Phenotype, PhenotypeError, Rig, animate, person
from rfgen_sionna.generative.bodies.sampled import load_mesh_sequence
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource, MotionSource
from rfgen_sionna.generative.motion.loaders import load_motion
from rfgen_sionna.generative.prompts import ScenePrompt, parse_prompt
from rfgen_sionna.records import MeshSequence, Motion
from rfgen_sionna.scene import actor as scene_actor

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_LOG = logging.getLogger(__name__)

DEFAULT_DISTANCE = 3.0
"""Distance from the radar where neither prompt nor caller says one [m]."""
DEFAULT_DURATION = 3.0
"""Length of a motion where the caller says none [s]."""


@dataclass(frozen=True, eq=False)
class Actor(scene_actor.Actor):
    """A :class:`rfgen_sionna.scene.Actor` that can be made from words, motions and clips."""

    motion: Motion | None = None
    """What it performs, where it has a skeleton."""
    prompt: ScenePrompt | None = None
    """The prompt it was made from."""
    body: Rig | None = None
    """Its body, where it is a person."""
    phenotype: Phenotype | None = None
    """What was asked of the body; the rest came from the seed."""

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
    ) -> Actor:
        """A person who does what a sentence says.

        Args:
            prompt: a sentence or keywords, such as "a tall woman walking back and forth, at 4 m", or one already read.
            seed: everything the prompt leaves open is drawn from it.
            duration: length of the motion [s].
            body: the body; a phenotype is completed from the seed, None takes what the prompt says.
            position: where the motion's origin stands on the floor, world frame [m]. None: the prompt's distance (3 m
                if it says none) in front of the radar, at height 0.
            orientation: (yaw, pitch, roll) [rad]. None: facing the radar, turned by the prompt's angle.
            negative: what is not wanted.
            material: name of a material.
            name: what labels call the person.
            radar: whom the person stands before; None is a radar at the origin looking along +x.
            source: where the motion comes from; None is the kinematic synthesiser.

        Raises:
            PromptError: the prompt cannot be carried out.
            PhenotypeError: the body cannot be had.
            ValueError: a duration, speed or hand that the source does not allow.
            ImportError: anny (or torch) is not installed.
        """
        said = prompt if isinstance(prompt, ScenePrompt) else parse_prompt(prompt, negative, seed=seed)
        for sentence in said.warnings:
            _LOG.warning(sentence)
        words = said.body
        wanted = Phenotype(words.gender, words.age_years, words.height_m, words.weight_kg, words.muscle)
        phenotype = body if isinstance(body, Phenotype) else wanted if body is None else None
        source = source or KinematicSource()
        place, yaw = _before(radar, said.distance_m or DEFAULT_DISTANCE)
        # the action is checked before the body is built, which may take a minute on a first start
        _check(said.action, duration)
        if isinstance(body, Rig):
            rig = body
        else:
            try:
                rig = person(phenotype, seed=seed)
            except PhenotypeError:
                # No one body has it all: what words asked for gives way, what numbers asked for does not.
                if phenotype is not wanted or not {"weight", "muscle"} <= words.drawn:
                    raise
                given = (words.muscle, words.weight_kg)
                _LOG.warning("body: no muscle of %g goes with %g kg here; the weight is kept", *given)
                phenotype = replace(wanted, muscle=None)
                rig = person(phenotype, seed=seed)
        motion = source(
            said.action,
            duration,
            seed,
            skeleton=rig.skeleton,
            hand=said.hand,
            speed=1.0 if said.speed is None else said.speed,
        )
        return cls(
            animate(rig, motion),
            material,
            name=name,
            position=cast(Any, place if position is None else position),
            orientation=cast(
                Any, (yaw + np.radians(said.orientation_deg or 0.0), 0.0, 0.0) if orientation is None else orientation
            ),
            motion=replace(motion, prompt=said.text),
            prompt=said,
            body=rig,
            phenotype=phenotype,
        )

    @classmethod
    def from_motion(
        cls,
        motion: Motion | str | PathLike[str],
        *,
        seed: int = 0,
        body: Rig | Phenotype | None = None,
        frame_rate: float | None = None,
        up: str = "z",
        position: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        material: str = "skin",
        name: str = "person",
        radar: Radar | None = None,
    ) -> Actor:
        """A person performing a motion, or a mesh sequence from files.

        Args:
            motion: a motion, an AMASS / SMPL / SMPL-H `.npz` file, or a folder of meshes of fixed connectivity.
            seed: what `body` leaves open is drawn from it.
            body: the body that performs a motion; not used for meshes, which are bodies themselves.
            frame_rate: frames per second of a folder of meshes [Hz], needed there and only there.
            up: up axis of the `.npz` clip's world, "z" (AMASS) or "y".
            position, orientation, material, name, radar: as in :meth:`from_prompt`, without a prompt.

        Raises:
            FileNotFoundError: there is no such file or folder.
            ClipError: the file cannot be used.
            ValueError: `frame_rate` is missing for meshes or given for a motion.
        """
        place, yaw = _before(radar, DEFAULT_DISTANCE)
        sequence: MeshSequence
        rig: Rig | None = None
        phenotype: Phenotype | None = None
        if not isinstance(motion, Motion) and not str(motion).endswith(".npz"):
            if frame_rate is None:
                raise ValueError(f"frame_rate: needed for the mesh sequence {motion}, in Hz")
            if body is not None:
                raise ValueError("body: a mesh sequence is its own body; leave it out")
            sequence, clip = load_mesh_sequence(motion, frame_rate=frame_rate, name=name), None
        else:
            if frame_rate is not None:
                raise ValueError("frame_rate: a motion has its own; leave it out")
            clip = motion if isinstance(motion, Motion) else load_motion(motion, up=up, action=Path(motion).stem)
            phenotype = None if isinstance(body, Rig) else body or Phenotype()
            rig = body if isinstance(body, Rig) else person(phenotype, seed=seed)
            sequence = animate(rig, clip)
        return cls(
            sequence,
            material,
            name=name,
            position=cast(Any, place if position is None else position),
            orientation=cast(Any, (yaw, 0.0, 0.0) if orientation is None else orientation),
            motion=clip,
            body=rig,
            phenotype=phenotype,
        )


def _check(action: str, duration: float) -> None:
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration: {duration!r} s; allowed is more than 0")
    if action not in ACTIONS:
        raise ValueError(f"action: {action!r} is unknown; allowed are {', '.join(ACTIONS)}")


def _before(radar: Radar | None, distance: float) -> tuple[tuple[float, float, float], float]:
    """Place on the floor at `distance` [m] in front of the radar, and the yaw [rad] that faces it."""
    if radar is None:
        return (distance, 0.0, 0.0), np.pi
    boresight = np.asarray(radar.rotation)[:, 0]
    level = float(np.hypot(boresight[0], boresight[1]))
    if level < 1e-6:
        raise ValueError("radar: it looks straight up or down, so there is no place before it; give `position`")
    ahead = boresight[:2] / level
    x, y = np.asarray(radar.position)[:2] + distance * ahead
    return (float(x), float(y), 0.0), float(np.arctan2(-ahead[1], -ahead[0]))
