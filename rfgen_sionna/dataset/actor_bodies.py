"""Actors as parameters: shape once, pose in every frame, from which their meshes are rebuilt.

A person is stored as the parameters of the body model, the world rotations of its bones and the position of its root
joint; breathing and heartbeat as inflation and pulse. A thing of rigid parts is stored as its mesh at rest and the
world rotation and translation of each part. In the group of the actor::

    body            attribute `record` (JSON): kind, and of a person the parameters of the body model
    body/rotation   (frame, bone or part, quaternion) world rotation from the pose at rest; x, y, z, w
    body/position   (frame, axis) of the root joint, or (frame, part, axis) translations [m]
    body/skin       (frame, signal) inflation by the breath, 0 … 1, and heartbeat, 0 … 1, of a person who breathes
    body/joint_rotation   (frame, joint, quaternion) world rotations of a person's joints relative to the T-pose
    body/rest, body/owner, body/faces, body/face_part   mesh of a thing at rest [m], and the part of each vertex
"""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.dataset.schema import RunFormatError, StoredArray, StoredAxis
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.rigid_mesh import RigidMesh

PERSON, RIGID = "person", "rigid"
"""Kinds of bodies: of the body model, and of rigid parts."""
_QUATERNION = StoredAxis(["x", "y", "z", "w"], "", "component of the unit quaternion")


class ActorBody:
    """Parameters of one actor, for a file.

    Raises
    ------
    ValueError
        If no parameters rebuild the actor's mesh, such as that of a mesh sequence from files; the message names it.
    """

    def __init__(self, actor: MeshActor) -> None:
        from rfgen_sionna.generative.bodies import BodySequence
        from rfgen_sionna.generative.bodies.body_record import BodyRecordError, body_record
        from rfgen_sionna.generative.things.articulated import ArticulatedSequence

        self.actor, sequence = actor, actor.sequence
        self.at = f"actors/{actor.name}/body"
        self.record: dict[str, Any] = {"kind": RIGID, "parts": list(actor.part_names)}
        self._rest: FloatArray = np.empty((0, 3))
        self._part: IntArray = np.empty(0, np.int32)
        if isinstance(sequence, BodySequence):
            try:
                self.record = self.record | {"kind": PERSON, **body_record(sequence)}
            except BodyRecordError as error:
                raise _not_rebuilt(actor, str(error)) from error
            if not np.array_equal(actor.faces, sequence.rig.faces):
                raise _not_rebuilt(actor, "its faces are not those of its body model")
        elif isinstance(sequence, RigidMesh):
            self._rest, self._part = sequence.points, np.zeros(len(sequence.points), np.int32)
        elif isinstance(sequence, ArticulatedSequence) and sequence.is_rigid:
            self._rest, self._part = sequence.rest_vertices, sequence.owners
        else:
            raise _not_rebuilt(actor, f"a {type(sequence).__name__} changes its shape freely")

    @property
    def arrays(self) -> dict[str, StoredArray]:
        """Declarations of the arrays with an entry in every frame, by their paths."""
        person = self.record["kind"] == PERSON
        part = ("bone",) if person else ("part",)
        found = {
            f"{self.at}/rotation": StoredArray(
                (*part, "quaternion"), "", "world rotation from the pose at rest",
                dtype="float32" if person else "float64", axes={"quaternion": _QUATERNION},
            ),
            f"{self.at}/position": StoredArray(
                (*(() if person else part), "axis"), "m",
                "world position of the root joint" if person else "world translation of the part", dtype="float64",
            ),
        }  # fmt: skip
        if person:
            found[f"{self.at}/joint_rotation"] = StoredArray(
                ("joint", "quaternion"), "", "world rotation of the joint relative to the T-pose"
            )
            if self.record["skin"] is not None:
                names = StoredAxis(["inflation", "pulse"], "", "signal of breath and heart")
                found[f"{self.at}/skin"] = StoredArray(
                    ("signal",), "1", "breath and heartbeat, 0 to 1", dtype="float64", axes={"signal": names}
                )
        return found

    @property
    def constants(self) -> dict[str, tuple[Any, StoredArray]]:
        """Values and declarations of the arrays without frames, by their paths."""
        if self.record["kind"] == PERSON:
            return {}
        return {
            f"{self.at}/rest": (
                self._rest.astype(np.float32), StoredArray(("vertex", "axis"), "m", "vertex position at rest"),
            ),
            f"{self.at}/owner": (
                self._part.astype(np.int32), StoredArray(("vertex",), "", "part of the vertex", dtype="int32"),
            ),
            f"{self.at}/faces": (
                self.actor.faces.astype(np.int32),
                StoredArray(("face", "corner"), "", "vertex numbers, counter-clockwise from outside", dtype="int32"),
            ),
            f"{self.at}/face_part": (
                np.asarray(self.actor.face_parts, np.int32),
                StoredArray(("face",), "", "index into the actor's parts", dtype="int32"),
            ),
        }  # fmt: skip

    def describe(self, group: h5py.Group) -> None:
        """Write the record to the `group` of the run."""
        group.require_group(self.at).attrs["record"] = json.dumps(self.record)

    def values(self, t: float) -> dict[str, Any]:
        """Entries of :attr:`arrays` at `t` [s]."""
        place, turn = self.actor.pose(t)
        sequence: Any = self.actor.sequence
        if self.record["kind"] == PERSON:
            rotations, root = sequence.pose(t)
            found = {
                f"{self.at}/rotation": _quaternions(turn @ rotations),
                f"{self.at}/position": turn @ root + place,
                f"{self.at}/joint_rotation": _quaternions(turn @ sequence.joint_rotations(t)),
            }
            signs = sequence.vital_signs
            if signs is not None:
                found[f"{self.at}/skin"] = np.array([signs.volume(t), signs.pulse(t)])
            return found
        turns, shifts = np.eye(3)[None], np.zeros((1, 3))
        if not isinstance(sequence, RigidMesh):
            turns, shifts = sequence.motions(t)
        return {
            f"{self.at}/rotation": _quaternions(turn @ turns),
            f"{self.at}/position": shifts @ turn.T + place,
        }


def body_vertices(actor: h5py.Group, frame: int) -> FloatArray:
    """(vertex, 3) world positions [m] in frame `frame`, rebuilt from the parameters in the group of an actor.

    Raises
    ------
    RunFormatError
        If the body model of this machine makes another body, or the record is unknown.
    ImportError
        If anny (or torch), which makes people, is not installed.
    """
    body = actor["body"]
    turns = Rotation.from_quat(np.asarray(body["rotation"][frame], np.float64)).as_matrix()
    position = np.asarray(body["position"][frame], np.float64)
    record = _record(actor)
    if record["kind"] == RIGID:
        owner = body["owner"][:]
        return np.asarray(np.einsum("vij,vj->vi", turns[owner], body["rest"][:]) + position[owner])
    from rfgen_sionna.generative.bodies.body_record import BodyRecordError, posed_vertices

    volume, pulse = body["skin"][frame] if "skin" in body else (0.0, 0.0)
    try:
        return posed_vertices(record, turns, position, float(volume), float(pulse))
    except BodyRecordError as error:
        raise RunFormatError(
            f"{actor.file.filename}: {actor.name}: {error}; install the version of anny of `Run.software`"
        ) from error


def body_faces(actor: h5py.Group) -> tuple[IntArray, IntArray, tuple[str, ...]]:
    """(face, 3) vertex numbers, (face,) indices into the parts, and names of the parts of an actor that is stored as
    parameters; errors as of :func:`body_vertices`."""
    record, body = _record(actor), actor["body"]
    parts = tuple(record["parts"])
    if record["kind"] == RIGID:
        return np.asarray(body["faces"][:]), np.asarray(body["face_part"][:]), parts
    from rfgen_sionna.generative.bodies.body_record import BodyRecordError, rig_of

    try:
        rig = rig_of(record)
    except BodyRecordError as error:
        raise RunFormatError(
            f"{actor.file.filename}: {actor.name}: {error}; install the version of anny of `Run.software`"
        ) from error
    return rig.faces, rig.face_parts, parts


def _record(actor: h5py.Group) -> dict[str, Any]:
    text = actor["body"].attrs.get("record", "")
    try:
        record = json.loads(text)
        if record["kind"] not in (PERSON, RIGID):
            raise ValueError("unknown kind")
    except (ValueError, TypeError, KeyError) as error:
        raise RunFormatError(
            f"{actor.file.filename}: attribute 'record' of '{actor.name}/body' is {str(text)[:60]!r}: a record of "
            "kind 'person' or 'rigid' is needed"
        ) from error
    return dict(record)


def _quaternions(rotations: FloatArray) -> FloatArray:
    return np.asarray(Rotation.from_matrix(rotations).as_quat(canonical=True))


def _not_rebuilt(actor: MeshActor, why: str) -> ValueError:
    return ValueError(
        f"keep has 'body', but no parameters rebuild the mesh of actor '{actor.name}': {why}; keep 'vertices' instead"
    )
