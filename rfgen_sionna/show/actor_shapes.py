"""Shape of an actor as viewers draw it: a decimated mesh, joints and the bones between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import ActorRecord, RunFormatError
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, PARENTS
from rfgen_sionna.show.displayable import Displayable

Points = NDArray[np.float32]


@dataclass(frozen=True)
class DecimatedMesh:
    """Mesh decimated by vertex clustering: vertices within one cell of a grid become one."""

    group: NDArray[np.int64]
    """(vertex,) number of each vertex' cluster."""
    faces: NDArray[np.int64]
    """(face, 3) numbers of clusters."""

    @classmethod
    def of(cls, actor: ActorRecord, most: int = 6000) -> DecimatedMesh:
        """Decimated mesh of an actor with at most `most` faces."""
        vertices = actor.vertices(0).astype(np.float64)
        cell = 0.0
        group = np.arange(len(vertices))
        faces = actor.faces.astype(np.int64)
        while len(faces) > most:
            cell = 1.3 * cell if cell else 0.004 * float(np.linalg.norm(np.ptp(vertices, axis=0)))
            _, group = np.unique(np.floor(vertices / cell), axis=0, return_inverse=True)
            group = group.reshape(-1)
            faces = group[actor.faces]
            distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
            faces = np.unique(faces[distinct], axis=0)
        return cls(group, faces)

    def points(self, vertices: NDArray[np.float32]) -> FloatArray:
        """(cluster, 3) mean positions of the clusters [m] for the actor's `vertices`."""
        count = np.bincount(self.group)
        return np.stack([np.bincount(self.group, vertices[:, axis]) / count for axis in range(3)], axis=1)

    def corners(self, vertices: NDArray[np.float32]) -> FloatArray:
        """(face, 3, 3) corner positions [m] for the actor's `vertices`."""
        return np.asarray(self.points(vertices)[self.faces])


@dataclass(frozen=True)
class ActorShape:
    """Drawable parts of an actor; those that the recording does not keep are empty."""

    name: str
    material: str
    faces: NDArray[np.int64]
    """(face, 3) numbers of the points of :meth:`mesh`."""
    bones: NDArray[np.int64]
    """(bone, 2) numbers of joints: parent and child. Empty for joints other than those of SMPL-H."""
    joint_names: tuple[str, ...]
    _actor: ActorRecord
    _mesh: DecimatedMesh | None

    @classmethod
    def of(cls, actor: ActorRecord, most: int = 6000) -> ActorShape:
        """Shape of an actor with at most `most` faces."""
        try:
            mesh = DecimatedMesh.of(actor, most)
        except RunFormatError:  # the recording stores neither vertices nor parameters of a body
            mesh = None
        faces = np.empty((0, 3), np.int64) if mesh is None else mesh.faces
        return cls(actor.name, actor.material, faces, _bones(actor.joint_names), actor.joint_names, actor, mesh)

    def mesh(self, frame: int) -> Points:
        """(point, 3) positions of the decimated mesh [m], world frame; (0, 3) without a mesh."""
        if self._mesh is None:
            return np.empty((0, 3), np.float32)
        return self._mesh.points(self._actor.vertices(frame)).astype(np.float32)

    def joints(self, frame: int) -> Points:
        """(joint, 3) positions [m], world frame; (0, 3) without joints."""
        return self._actor.joints(frame).astype(np.float32)

    def points(self, frame: int) -> Points:
        """(point, 3) positions of the mesh, or of the joints where there is no mesh [m]."""
        found = self.mesh(frame)
        return found if len(found) else self.joints(frame)


def actor_shapes(run: Displayable, most: int = 6000) -> list[ActorShape]:
    """Shapes of all actors of a run, which share `most` faces."""
    return [ActorShape.of(actor, most // len(run.actors)) for actor in run.actors.values()]


def _bones(names: tuple[str, ...]) -> NDArray[np.int64]:
    index = {name: number for number, name in enumerate(names)}
    pairs = [
        (index[JOINT_NAMES[PARENTS[JOINT[name]]]], number)
        for name, number in index.items()
        if name in JOINT and PARENTS[JOINT[name]] >= 0 and JOINT_NAMES[PARENTS[JOINT[name]]] in index
    ]
    return np.array(pairs, np.int64).reshape(-1, 2)
