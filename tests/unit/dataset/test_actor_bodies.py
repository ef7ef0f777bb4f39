"""Parameters of an actor give back its mesh, in every frame and wherever it is read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.dataset import RunFormatError
from rfgen_sionna.frame_loop import Frame
from rfgen_sionna.generative.bodies import VitalSigns
from rfgen_sionna.generative.bodies.sampled import SampledSequence

BALL = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
KEEP = ("body", "joints", "labels")
NEAREST = 1e-4
"""Largest distance of a rebuilt vertex [m]."""


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Any:
    return rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


class Untraced(rfgen.Simulator):
    """Frames without returns: meshes need no trace."""

    def frames(self, duration: float, **options: Any) -> Any:
        for index, time in enumerate(self.frame_times(duration)):
            yield Frame(index, float(time), np.zeros(self.radar.frame_shape, np.complex128), report=None)  # type: ignore[arg-type]


def check(path: Path, radar: Any, actor: Any, duration: float = 0.1) -> None:
    """The mesh of a recorded actor is its own, from a file alone."""
    sim = Untraced(None, radar, [actor], rtol=0.1)
    sim.record(path, duration, keep=KEEP).close()
    with rfgen.open_run(path) as run:
        found = run.actors[actor.name]
        assert "vertices" not in run.stored(f"actors/{actor.name}")
        for frame, t in enumerate(run.mesh_times):
            away = np.linalg.norm(found.vertices(frame) - actor.vertices(t), axis=1)
            assert away.max() < NEAREST
        np.testing.assert_array_equal(found.faces, actor.faces)
        np.testing.assert_array_equal(found.face_parts, actor.face_parts)
        assert found.part_names == actor.part_names


def test_a_rigid_thing_is_its_mesh_and_its_pose(radar: Any, tmp_path: Path) -> None:
    def way(t: float) -> Any:
        return (3 + 0.3 * t, 0.2 * t, 1), (2 * t, 0.5, -t)

    box = trimesh.creation.box((0.3, 0.2, 0.1)).subdivide()
    check(tmp_path / "box.h5", radar, rfgen.Actor.from_mesh(box, material="metal", trajectory=way, name="box"))
    ball = rfgen.Actor.from_mesh(BALL, material="metal", position=(3, 0, 1), velocity=(1, 0, 0), name="ball")
    check(tmp_path / "ball.h5", radar, ball)


def test_a_thing_of_rigid_parts_is_its_mesh_and_the_pose_of_each_part(radar: Any, tmp_path: Path) -> None:
    check(tmp_path / "run.h5", radar, rfgen.Actor.thing("drone", position=(3, 0, 1), radar=radar))


def test_a_shape_that_changes_freely_is_refused_with_the_cure(radar: Any, tmp_path: Path) -> None:
    shapes = np.stack([BALL.vertices, 1.1 * BALL.vertices, BALL.vertices])
    soft = rfgen.Actor(SampledSequence(shapes, np.asarray(BALL.faces, np.int32), 10.0, ("soft",)), "metal", name="soft")
    sim = Untraced(None, radar, [replace(soft, position=(3.0, 0.0, 1.0))], rtol=0.1)
    with pytest.raises(ValueError, match=r"no parameters rebuild the mesh of actor 'soft'.*keep 'vertices' instead"):
        sim.record(tmp_path / "run.h5", 0.1, keep=KEEP)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def person(radar: Any) -> Any:
    made = rfgen.Actor.from_prompt("a woman waves", seed=3, duration=1.0, motion="kinematic", radar=radar)
    return made.with_vital_signs(VitalSigns(15.0, 70.0))


def test_a_person_who_breathes_is_rebuilt_from_parameters(radar: Any, person: Any, tmp_path: Path) -> None:
    check(tmp_path / "run.h5", radar, person)
    turned = replace(person, position=(3.0, 0.5, 0.2), orientation=(0.7, 0.1, 0.0))
    check(tmp_path / "turned.h5", radar, turned, 0.05)
    with rfgen.open_run(tmp_path / "run.h5") as run:
        # A fifth of the vertices of one frame would take more than all that is stored.
        stored = run.stored("actors/person/body")
        assert sum(each.nbytes for each in stored.values()) < 13718 * 3 * 4 / 5
        turns = run.array("actors/person/body/joint_rotation")
        assert turns.shape == (2, 52, 4)


def test_another_body_model_is_noticed(radar: Any, person: Any, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    Untraced(None, radar, [person], rtol=0.1).record(path, 0.05, keep=KEEP).close()
    with h5py.File(path, "r+") as file:
        group = file["actors/person/body"]
        group.attrs["record"] = group.attrs["record"].replace('"height": 0.', '"height": 0.1')
    with (
        rfgen.open_run(path) as run,
        pytest.raises(RunFormatError, match=r"another body of these parameters.*`Run.software`"),
    ):
        run.actors["person"].vertices(0)
    with h5py.File(path, "r+") as file:
        file["actors/person/body"].attrs["record"] = "[1]"
    with rfgen.open_run(path) as run, pytest.raises(RunFormatError, match="a record of kind 'person' or 'rigid'"):
        run.actors["person"].vertices(0)


def test_a_measured_person_is_rebuilt_from_the_parameters_and_bone_lengths(
    radar: Any, person: Any, tmp_path: Path
) -> None:
    times = np.arange(0.0, 1.0, 1 / 30)
    positions = np.stack([person.sequence.joints(t)[:22] for t in times]) * 1.05
    measured = rfgen.Actor.from_joints(positions, layout="smpl22", frame_rate=30.0, position=(3, 0, 0))
    check(tmp_path / "run.h5", radar, measured)
