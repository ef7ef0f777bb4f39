"""Run one fall: real motion up to its moment, then the jointed body under gravity, contact and fading tone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import between, to_matrices
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    MEAN_ADULT,
    NUM_BODY_JOINTS,
    PARENTS,
    SIDES,
    forward_kinematics,
    global_rotations,
)
from rfgen_sionna.records import Motion
from training.motion.falls.body import NAMES, STEP, depth_first, hinge_order, kind_of, middle_of, model_xml
from training.motion.falls.scenarios import Scenario
from training.motion.mocap import find_contacts

try:
    import mujoco
except ImportError as error:
    raise ImportError(
        "falls by physics need MuJoCo, which is not installed: pip install 'rfgen-sionna[training]'"
    ) from error

RATE = 20.0
"""Poses per second of a written motion [Hz]: that of the captured clips."""
_FINE = 200.0
"""Poses per second of the simulation's own record [Hz]."""
_SMOOTHING = 0.012
"""Of that record before it is thinned out [s]: skin and clothes give way more slowly than the contact model."""
CONTROL = 0.01
"""Time between two settings of tone and forces [s]."""
_LONGEST = 4.0
"""Longest simulated time [s]."""
_STILL = 0.08
"""Speed of all joints of a body that has come to rest [m/s]."""


@dataclass(frozen=True)
class _Tone:
    """Spring and damper of a joint's hinges: as in standing, and those of a body at rest."""

    stiffness: float
    """[N m/rad]"""
    damping: float
    """[N m s/rad]"""
    slack: float
    """Stiffness at rest [N m/rad]."""
    passive: float
    """Damping at rest [N m s/rad]."""
    strength: float
    """Largest torque of the spring [N m]."""
    group: str


# Strength: about the largest voluntary torques of adults (hip and knee 200 to 300 N m, ankle 150), less than half of
# them in arms (70 N m), which reach and do not strike. Stiffness in standing: of the order of the weight times the
# height that it carries per radian, which balance needs (Winter et al., Journal of Neurophysiology 80 (1998) 1211).
# Values at rest are an estimate: free limbs settle within a swing.
_TONES: Mapping[str, _Tone] = MappingProxyType(
    {
        "spine1": _Tone(500.0, 25.0, 15.0, 8.0, 200.0, "trunk"),
        "spine2": _Tone(500.0, 25.0, 15.0, 8.0, 200.0, "trunk"),
        "spine3": _Tone(500.0, 25.0, 15.0, 8.0, 200.0, "trunk"),
        "neck": _Tone(60.0, 4.0, 2.0, 1.2, 40.0, "trunk"),
        "head": _Tone(60.0, 4.0, 2.0, 1.2, 40.0, "trunk"),
        "collar": _Tone(200.0, 8.0, 30.0, 3.0, 80.0, "trunk"),
        "shoulder": _Tone(50.0, 6.0, 0.5, 1.2, 30.0, "arms"),
        "elbow": _Tone(30.0, 2.5, 0.5, 0.6, 20.0, "arms"),
        "wrist": _Tone(8.0, 0.4, 1.0, 0.15, 10.0, "arms"),
        "hip": _Tone(500.0, 25.0, 1.5, 4.0, 250.0, "hips"),
        "knee": _Tone(400.0, 15.0, 1.0, 2.0, 250.0, "legs"),
        "ankle": _Tone(300.0, 8.0, 3.0, 1.0, 150.0, "legs"),
        "foot": _Tone(20.0, 0.5, 4.0, 0.3, 20.0, "legs"),
    }
)
_REST = {"hip": -15.0, "knee": 20.0, "ankle": 20.0, "elbow": -25.0}
"""First hinge of a relaxed left joint [degrees]."""


@dataclass(frozen=True)
class Fall:
    """What came of one scenario."""

    scenario: Scenario
    motion: Motion
    """On the mean adult, on the floor z = 0."""
    begins: int
    """Frame at which physics takes over."""
    deepest: float
    """Deepest that two segments were in one another, at any time [m]."""
    deepest_at_rest: float
    """The same at the end [m]."""
    heights: Mapping[str, float]
    """Height over the floor of the lowest point of each segment at the end [m]; 0 for one that rests on another segment
    or on furniture."""


class FallingBody:
    """The body of one scenario, from its start to rest."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        start = scenario.start
        turns, place = start.pose(start.time)
        self._seat = self._stool(turns, place)
        angles = _angles(turns)
        self.model = mujoco.MjModel.from_xml_string(
            model_xml(
                scenario.size,
                scenario.mass,
                {name: np.degrees(each) for name, each in angles.items()},
                self._seat,
                back=scenario.seat == "chair",
            )
        )
        self._furniture = {"stool": ["seat"], "chair": ["seat", "back"]}.get(scenario.seat, [])
        self.data = mujoco.MjData(self.model)
        self._id = {name: self.model.body(name).id for name in NAMES}
        self._lift = self._height(start.time)
        if self._seat is not None and scenario.seat == "stool":
            self.model.body("seat").pos[2] += self._lift
            self._seat[2] += self._lift
        self.data.qpos[:] = self._state(start.time)
        before, after = (self._state(start.time + step) for step in (-0.03, 0.03))
        mujoco.mj_differentiatePos(self.model, self.data.qvel, 0.06, before, after)
        mujoco.mj_forward(self.model, self.data)
        self._prepare_tone()
        facing = to_matrices(turns[0])[:, 0]
        heading = np.arctan2(facing[1], facing[0])
        angle = heading + np.radians(scenario.direction)
        self._ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        self._way = np.array([np.cos(angle), np.sin(angle), 0.0])
        self._swing = self._id[f"{start.swing}_foot"] if start.swing else -1
        self._caught = self.data.xpos[self._swing].copy() if start.swing else np.zeros(3)
        if scenario.slips:
            for name in (f"{side}_{part}_0" for side in SIDES for part in ("ankle", "foot")):
                self.model.geom(name).priority = 1
                self.model.geom(name).friction = [0.04, 0.005, 0.0001]

    def _stool(self, turns: FloatArray, place: FloatArray) -> FloatArray | None:
        """(4,) place of the middle of the seat's upper side [m] and the heading of who sits there [rad]."""
        case = self._scenario
        if not case.seat:
            return None
        facing = to_matrices(turns[0])[:, 0]
        heading = float(np.arctan2(facing[1], facing[0]))
        ahead, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
        if case.seat == "chair":
            return np.array([*case.size * (place[:2] - 0.25 * ahead), case.seat_height, heading])
        # who slides off sits near the side of the stool
        aside = -0.1 * np.sin(np.radians(case.direction))
        middle = case.size * (place[:2] + 0.06 * ahead + aside * left)
        return np.array([*middle, case.size * (place[2] - 0.112), heading])

    def _height(self, time: float) -> float:
        """By how much the clip is raised so that its lowest shape is on the floor at a time [m]."""
        self._lift = 0.0
        self.data.qpos[:] = self._state(time)
        mujoco.mj_forward(self.model, self.data)
        return -min(clearance(self.model, self.data, geom) for geom in shapes(self.model))

    def _state(self, time: float) -> FloatArray:
        turns, place = self._scenario.start.pose(time)
        root = turns[0, [3, 0, 1, 2]]
        parts = [place * self._scenario.size + [0.0, 0.0, self._lift], root]
        angles = _angles(turns)
        for name in depth_first()[1:]:
            if kind_of(name) == "shoulder":
                own = middle_of(name.partition("_")[0]).inv() * Rotation.from_quat(turns[JOINT[name]])
                parts.append(own.as_quat()[[3, 0, 1, 2]])
            else:
                parts.append(angles[name])
        return np.concatenate(parts)

    def _prepare_tone(self) -> None:
        """Tables of the joints (hinges and balls) below the root, and the postures that tone holds."""
        model = self.model
        names = [model.body(body).name for body in model.jnt_bodyid[1:]]
        tones = [_TONES[kind_of(name)] for name in names]
        self._tone = np.array([[t.stiffness, t.damping, t.slack, t.passive, t.strength] for t in tones])
        self._group = np.array([("legs", "trunk", "arms", "hips").index(t.group) for t in tones])
        self._balls = [names.index(f"{side}_shoulder") for side in SIDES]
        self._shoulders = [np.arange(4) + model.jnt_qposadr[1 + joint] for joint in self._balls]
        self._elbows = [model.jnt_qposadr[1 + names.index(f"{side}_elbow")] for side in SIDES]
        self._first = self.data.qpos.copy()
        self._bent, self._slack = self._first.copy(), np.zeros(model.nq)
        for k, name in enumerate(names):
            kind, row = kind_of(name), model.jnt_qposadr[1 + k]
            if kind == names[k - 1].partition("_")[2] and name == names[k - 1]:
                continue  # not the first hinge
            if kind in self._scenario.bend:
                bent = self._scenario.bend[kind] * (-1.0 if kind == "hip" else 1.0)
                uneven = self._scenario.uneven * {"left": 1.0, "right": -1.0}.get(name.partition("_")[0], 0.0)
                self._bent[row : row + 3] = np.radians([bent * (1.0 + uneven), 0.0, 0.0])
            self._slack[row] = np.radians(_REST.get(kind, 0.0)) * (-1.0 if name == "right_elbow" else 1.0)
        self._hinged = np.ones(model.nq - 7)
        for rows in self._shoulders:
            self._hinged[rows - 7] = 0.0

    def run(self) -> Fall:
        """The motion, from the start's lead-in to rest."""
        places, turns, still, deepest = [], [], 0.0, 0.0
        record, control = round(1.0 / (_FINE * STEP)), round(CONTROL / STEP)
        self._last = self.data.xpos.copy()
        for step in range(round(_LONGEST / STEP) + 1):
            if step % control == 0:
                speed = np.linalg.norm(self.data.xpos - self._last, axis=1).max() / CONTROL
                still = still + CONTROL if speed < _STILL else 0.0
                deepest = max(deepest, self._overlap())
                if still > 0.6 and step * STEP > 1.5:
                    break
                self._control(step * STEP)
                self._last = self.data.xpos.copy()
            if step % record == 0:
                places.append(self.data.xpos[self._id["pelvis"]].copy())
                turns.append(self.data.xquat[list(self._id.values())])
            mujoco.mj_step(self.model, self.data)
        motion = self._motion(np.array(places), np.array(turns))
        begins = min(self._scenario.start.frame, self._scenario.start.lead)
        return Fall(self._scenario, motion, begins, deepest, self._overlap(), self._heights())

    def _overlap(self) -> float:
        """Depth of the deepest contact between two segments [m]."""
        contacts = self.data.contact
        bodies = self.model.geom_bodyid[contacts.geom]
        own = (self.model.body_rootid[bodies] == self._id["pelvis"]).all(axis=1)
        return float(-contacts.dist[own].min(initial=0.0))

    def _heights(self) -> dict[str, float]:
        touching = self.model.geom_bodyid[self.data.contact.geom]
        floor = self.model.geom("floor").bodyid[0]
        held = set(touching[(touching != floor).all(axis=1)].ravel().tolist())
        heights: dict[str, float] = {}
        for geom in shapes(self.model):
            body = self.model.geom_bodyid[geom]
            name = self.model.body(body).name
            height = clearance(self.model, self.data, geom)
            heights[name] = min(heights.get(name, np.inf), min(height, 0.0) if body in held else height)
        return heights

    # control

    def _control(self, time: float) -> None:
        """Springs and dampers of the joints, and the forces from outside, at a time [s]."""
        case, model = self._scenario, self.model
        calm = 0.0 if case.rest is None else float(np.clip((time - case.rest) / 0.3, 0.0, 1.0))
        share = np.array([fade(time) for fade in (case.legs, case.trunk, case.arms, case.hips or case.legs)])[
            self._group
        ]
        target = self._first + float(np.clip((time - case.legs.start) / 0.35, 0.0, 1.0)) * (self._bent - self._first)
        if case.reach is not None and time > case.reach:
            share = np.where(self._group == 2, np.maximum(share, 0.8), share)
            target[self._elbows] = np.radians([-30.0, 30.0])
            for side, rows in zip(SIDES, self._shoulders, strict=True):
                target[rows] = self._reach(side)
        share = share * (1.0 - calm)
        target[7:] += calm * (self._slack - target)[7:] * self._hinged
        error = np.abs(self.data.qpos - target)[model.jnt_qposadr[1:]]
        for joint, rows in zip(self._balls, self._shoulders, strict=True):
            error[joint] = 2.0 * np.arccos(np.clip(abs(self.data.qpos[rows] @ target[rows]), 0.0, 1.0))
        tone = self._tone
        stiffness = share * tone[:, 0] + (1.0 - share) * tone[:, 2]
        model.jnt_stiffness[1:] = np.minimum(stiffness, tone[:, 4] / np.maximum(error, 1e-3))
        model.dof_damping[6:] = (share * tone[:, 1] + (1.0 - share) * tone[:, 3])[model.dof_jntid[6:] - 1]
        model.qpos_spring[7:] = target[7:]
        self._forces(time)

    def _reach(self, side: str) -> FloatArray:
        """Ball of a shoulder whose arm points to the floor where the body falls."""
        sign = 1.0 if side == "left" else -1.0
        collar = self.data.xmat[self._id[f"{side}_collar"]].reshape(3, 3)
        aside = sign * self.data.xmat[self._id["spine3"]].reshape(3, 3)[:, 1]
        goal = collar.T @ (self._way + 0.25 * aside - [0.0, 0.0, 0.8])
        goal /= np.linalg.norm(goal)
        middle = middle_of(side)
        turned = Rotation.from_matrix(between(middle.apply([0.0, sign, 0.0]), goal)) * middle
        own: FloatArray = (middle.inv() * turned).as_quat()[[3, 0, 1, 2]]
        return own

    def _forces(self, time: float) -> None:
        """Push on the chest, hold of the obstacle, drive of the slipping foot; a stool that nobody sits on is gone."""
        case, applied = self._scenario, self.data.xfrc_applied
        applied[:] = 0.0
        if time < case.push_time:
            pushed = self._id["pelvis" if case.seat == "chair" else "spine3"]
            applied[pushed, :3] += case.push * np.sin(np.pi * time / case.push_time) * self._way
        if time < case.held:
            at = self.data.xpos[self._swing]
            speed = (at - self._last[self._swing]) / CONTROL
            applied[self._swing, :3] += np.clip(4000.0 * (self._caught - at) - 200.0 * speed, -600.0, 600.0)
        if case.slips and time < 0.3:
            drive = case.slips * (1.0 - time / 0.3) * self._ahead
            applied[self._swing, :3] += drive
            applied[self._id["spine3"], :3] -= drive
        if self._seat is not None:
            pelvis = self.data.xpos[self._id["pelvis"]]
            off = np.linalg.norm(pelvis[:2] - self._seat[:2]) > 0.3 or pelvis[2] < self._seat[2]
            if case.seat == "stool" and off:
                for name in self._furniture:
                    self.model.geom(name).contype = self.model.geom(name).conaffinity = 0
                self._seat = None

    # record

    def _motion(self, places: FloatArray, turns: FloatArray) -> Motion:
        """(time, 3) and (time, 22, 4) world poses at `_FINE`, from the start on, after the lead-in of the clip."""
        case, start = self._scenario, self._scenario.start
        quaternions = turns[..., [1, 2, 3, 0]]
        world = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(-1, NUM_BODY_JOINTS, 3, 3)
        local = world.copy()
        for j in range(1, NUM_BODY_JOINTS):
            local[:, j] = np.swapaxes(world[:, PARENTS[j]], 1, 2) @ world[:, j]
        own = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(-1, NUM_BODY_JOINTS, 4)
        every = round(_FINE / RATE)
        # the smoothing reaches back into the clip
        back = [start.pose(start.time - k / _FINE) for k in range(every, 0, -1)]
        fine = np.concatenate([np.array([turn for turn, _ in back]), own])
        for k in range(1, len(fine)):
            fine[k] *= np.where(np.sum(fine[k] * fine[k - 1], axis=-1) < 0.0, -1.0, 1.0)[:, None]
        raised = np.array([0.0, 0.0, self._lift])
        way = np.concatenate([np.array([place for _, place in back]) * case.size + raised, places]) / case.size
        fine, way = (gaussian_filter1d(each, _SMOOTHING * _FINE, axis=0) for each in (fine, way))
        fine /= np.linalg.norm(fine, axis=-1, keepdims=True)
        lead = slice(max(start.frame - start.lead, 0), start.frame)
        rotations = np.concatenate([start.motion.rotations[lead], fine[every::every]])
        translation = np.concatenate([start.motion.translation[lead] + raised / case.size, way[every::every]])
        return placed(rotations, translation, case.action)


def placed(rotations: FloatArray, translation: FloatArray, action: str) -> Motion:
    """A motion of the mean adult that begins at the origin and faces +x there."""
    facing = to_matrices(rotations[0, 0])[:, 0]
    turn = Rotation.from_euler("z", -np.arctan2(facing[1], facing[0]))
    rotations = rotations.copy()
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    translation = turn.apply(translation - translation[0] * [1.0, 1.0, 0.0])
    parents, offsets = PARENTS[:NUM_BODY_JOINTS], np.asarray(MEAN_ADULT.offsets[:NUM_BODY_JOINTS])
    places = forward_kinematics(global_rotations(to_matrices(rotations), parents), translation, offsets, parents)
    return Motion(
        rotations=rotations,
        translation=translation,
        frame_rate=RATE,
        joint_names=NAMES,
        parents=parents,
        offsets=offsets,
        contacts=find_contacts(places, RATE),
        action=action,
    )


def _angles(turns: FloatArray) -> dict[str, FloatArray]:
    """Hinges of each joint but pelvis and shoulders, (3,) [rad]."""
    return {
        name: Rotation.from_quat(turns[JOINT[name]]).as_euler(hinge_order(name))
        for name in NAMES[1:]
        if kind_of(name) != "shoulder"
    }


def shapes(model: mujoco.MjModel) -> list[int]:
    """Shapes of the body that touch."""
    root = model.body(NAMES[0]).id
    own = model.body_rootid[model.geom_bodyid] == root
    return [int(g) for g in np.flatnonzero(own & (model.geom_contype > 0))]


def clearance(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of the lowest point of a shape over the floor [m]."""
    axes, size = data.geom_xmat[geom].reshape(3, 3), model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
        reach = size[0] + abs(axes[2, 2]) * size[1]
    else:
        reach = np.abs(axes[2]) @ size
    return float(data.geom_xpos[geom, 2] - reach)
