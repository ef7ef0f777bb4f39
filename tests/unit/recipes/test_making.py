"""Recordings: several radars see one scene, seeds draw what they name, and files are sources as prompts are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from rfgen_sionna.dataset import open_run
from rfgen_sionna.dataset.disk_space import DiskSpaceError
from rfgen_sionna.dataset.schema import RunFormatError
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.dataset.verified_files import ChecksumError
from rfgen_sionna.generative import MotionLibrary
from rfgen_sionna.generative.prompts import PromptError
from rfgen_sionna.recipes import making, recording_job
from rfgen_sionna.recipes.making import make_recording, make_with_attempts, recording_plans
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recipe_sources import changes_freely, check_source_file, read_source
from rfgen_sionna.recipes.recipe_tables import SourceTable
from rfgen_sionna.recipes.recording_job import RecordingJob
from rfgen_sionna.recipes.recording_spec import BodySpec, RadarSpec, RecordingSpec, SourceSpec
from rfgen_sionna.scene.scene_errors import PlacementError
from rfgen_sionna.signal.noise import noise_seed
from tests.unit.recipes.small_recipes import write_small_recipe


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("meshes") / "ball.stl"
    trimesh.creation.icosphere(subdivisions=1, radius=0.2).export(path)
    return path


@pytest.fixture
def spec(ball: Path, tiny_toml: Path) -> RecordingSpec:
    """Recording of a ball 3 m before a radar."""
    return RecordingSpec(
        number=12, attempt=0, split="train", seed=5, motion_seed=6, place="free space", place_seed=7, bodies=(),
        sources=(SourceSpec("mesh", file=str(ball), options={"material": "metal"}),),
        radars=(RadarSpec("", str(tiny_toml)),), duration_s=0.1, distance_m=3.0, rtol=0.05, keep=("adc", "labels"),
    )  # fmt: skip


def labels(spec: RecordingSpec) -> dict[str, dict[str, Any]]:
    """Labels of the middle of the first frame of each radar."""
    found = {}
    for name, plan in recording_plans(spec).items():
        simulator = plan.simulation
        found[name] = making.actor_labels(simulator.actors, simulator.radar, 0.0)
    return found


def test_a_ball_rolls_on_the_floor_at_its_distance_and_azimuth(spec: RecordingSpec) -> None:
    (found,) = labels(replace(spec, azimuth_deg=20.0)).values()
    angle = np.radians(20.0)
    np.testing.assert_allclose(found["position"][0], [3.0 * np.cos(angle), 3.0 * np.sin(angle), 0.2], atol=5e-3)
    (found,) = labels(replace(spec, sources=(replace(spec.sources[0], options={
        "material": "metal", "position_m": [2.0, -1.0, 1.5], "velocity_m_s": [0.0, 0.5, 0.0]
    }),))).values()  # fmt: skip
    np.testing.assert_allclose(found["position"][0], [2.0, -1.0, 1.5], atol=5e-3)
    np.testing.assert_allclose(found["velocity"][0], [0.0, 0.5, 0.0], atol=1e-6)


def test_several_balls_stand_in_a_row(spec: RecordingSpec) -> None:
    (found,) = labels(replace(spec, sources=spec.sources * 3)).values()
    places = np.array(found["position"])[:, :2]
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 3.0, atol=5e-3)
    assert np.diff(np.sort(places[:, 1])).min() > 1.0


def test_several_radars_record_one_scene_with_noise_of_their_own(
    spec: RecordingSpec, tiny_toml: Path, tmp_path: Path
) -> None:
    two = (RadarSpec("left", str(tiny_toml)), RadarSpec("right", str(tiny_toml), position_m=(0.0, 0.0, 1.0)))
    plans = recording_plans(replace(spec, radars=two))
    first, second = (plan.simulation for plan in plans.values())
    assert first.scene is second.scene
    assert all(one is other for one, other in zip(first.actors, second.actors, strict=True))
    make_recording(replace(spec, radars=two), tmp_path / "two.h5")
    with open_run(tmp_path / "two.h5") as run:
        assert set(run.radars) == {"left", "right"}
        left, right = run["left"], run["right"]
        assert left.seeds["noise"] == 5
        assert right.seeds["noise"] == noise_seed(5, 1) != 5
        assert not np.array_equal(left.adc[0], right.adc[0])  # at one place, with other noise
        np.testing.assert_array_equal(left.labels["position"].values[0], right.labels["position"].values[0])


def test_a_radar_of_another_band_has_a_scene_of_its_own(spec: RecordingSpec, tiny_toml: Path) -> None:
    two = (RadarSpec("tiny", str(tiny_toml)), RadarSpec("other", "iwr6843isk"))
    plans = recording_plans(replace(spec, radars=two, place="furnished: an office", distance_m=2.5))
    first, second = (plan.simulation for plan in plans.values())
    assert first.scene is not second.scene
    assert first.scene.name == second.scene.name
    for one, other in zip(first.scene.objects, second.scene.objects, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)


def test_a_run_has_what_it_is_made_of_without_folders(spec: RecordingSpec, tmp_path: Path, ball: Path) -> None:
    make_recording(spec, tmp_path / "run.h5")
    with open_run(tmp_path / "run.h5") as run:
        assert run.recording["number"] == 12
        assert run.recording["sources"][0]["file"] == ball.name
        assert run.recording["radars"][0]["radar"] == "tiny.toml"
        assert set(run.contents) == {"adc", "labels"}
    make_recording(spec, tmp_path / "again.h5")
    assert (tmp_path / "run.h5").read_bytes() == (tmp_path / "again.h5").read_bytes()


def test_what_cannot_be_placed_is_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = Recipe.load(write_small_recipe(tmp_path / "recipe"))
    tried: list[float | None] = []

    def make(spec: RecordingSpec, path: Path, device: str) -> None:
        tried.append(spec.distance_m)
        if len(tried) < 2:
            raise PlacementError("somebody is in a wall")

    monkeypatch.setattr(making, "make_recording", make)
    assert make_with_attempts(recipe, 3, tmp_path / "run.h5").attempt == 1
    assert tried == [recipe.recording(3, attempt).distance_m for attempt in (0, 1)]
    tried.clear()
    monkeypatch.setattr(making, "make_recording", lambda *_: make_fail("somebody is in a wall"))
    with pytest.raises(PlacementError, match="none of 2 draws could be made, the last one: somebody is in a wall"):
        make_with_attempts(recipe, 3, tmp_path / "run.h5")


def make_fail(reason: str, kind: type[Exception] = PlacementError) -> None:
    raise kind(reason)


@pytest.mark.parametrize(
    ("kind", "outcome"),
    [
        (DiskSpaceError, "disk full"), (OutputError, "error"), (RunFormatError, "error"), (ChecksumError, "error"),
        (PermissionError, "error"), (ValueError, "error"), (PlacementError, "impossible"), (PromptError, "impossible"),
    ],
)  # fmt: skip
def test_only_what_a_draw_cannot_be_is_drawn_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Exception], outcome: str
) -> None:
    recipe = Recipe.load(write_small_recipe(tmp_path / "recipe"))
    tried: list[int] = []

    def make(spec: RecordingSpec, *_: Any) -> None:
        tried.append(spec.attempt)
        make_fail("a fault", kind)

    monkeypatch.setattr(making, "make_recording", make)
    monkeypatch.setattr(recording_job, "prepare_worker", lambda: None)
    made = RecordingJob(recipe, tmp_path)(3)
    assert made.kind == outcome
    assert made.reason.endswith("a fault")
    assert tried == ([0, 1] if outcome == "impossible" else [0])


def test_a_ball_out_of_range_is_refused(spec: RecordingSpec, tmp_path: Path) -> None:
    with pytest.raises(PlacementError, match="range"):
        make_recording(replace(spec, distance_m=40.0), tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def person(spec: RecordingSpec) -> RecordingSpec:
    pytest.importorskip("anny", reason="people need the body model")
    return replace(
        spec, sources=(SourceSpec("prompt", "a woman pushes"),), bodies=(BodySpec(3),), motion="kinematic",
        azimuth_deg=10.0, orientation_deg=90.0, distance_m=2.0,
    )  # fmt: skip


def only(spec: RecordingSpec) -> Any:
    """The person of a recording."""
    (plan,) = recording_plans(spec).values()
    (actor,) = plan.simulation.actors
    return actor


def rest(actor: Any) -> Any:
    """Vertices of a body at rest [m]."""
    return np.asarray(actor.body.vertices)


def test_one_body_seed_is_one_body_whatever_the_motion(person: RecordingSpec) -> None:
    one, other = only(person), only(replace(person, motion_seed=99))
    np.testing.assert_array_equal(rest(one), rest(other))
    assert not np.array_equal(one.vertices(0.05), other.vertices(0.05))
    another = only(replace(person, bodies=(BodySpec(4),)))
    assert not np.array_equal(rest(one), rest(another))
    tall = only(replace(person, bodies=(BodySpec(3, height_m=1.9),)))
    assert np.ptp(tall.vertices(0.0)[:, 2]) == pytest.approx(1.9, abs=0.08)


def test_the_recording_places_its_people(person: RecordingSpec) -> None:
    (found,) = labels(person).values()
    position = np.asarray(found["position"][0])
    assert np.hypot(*position[:2]) == pytest.approx(2.0, abs=0.25)
    assert np.degrees(np.arctan2(position[1], position[0])) == pytest.approx(10.0, abs=6.0)
    # facing the radar is 190 degrees there, and then 90 degrees to the person's left
    assert np.degrees(found["orientation"][0]) % 360.0 == pytest.approx(280.0, abs=15.0)


def test_people_of_several_prompts_stand_apart(person: RecordingSpec) -> None:
    two = replace(
        person, sources=(*person.sources, SourceSpec("prompt", "a man stands")), bodies=(BodySpec(3), BodySpec(8)),
        orientation_deg=None,
    )  # fmt: skip
    (plan,) = recording_plans(two).values()
    assert [actor.name for actor in plan.simulation.actors] == ["person", "person_2"]
    assert plan.info.prompt == "a woman pushes; a man stands"
    places = [np.asarray(actor.vertices(0.0)).mean(axis=0)[:2] for actor in plan.simulation.actors]
    assert np.linalg.norm(places[0] - places[1]) > 0.8
    with pytest.raises(ValueError, match="bodies are 1, fewer than the people"):
        recording_plans(replace(two, bodies=(BodySpec(3),)))


def test_clips_and_joints_are_people_too(person: RecordingSpec, tmp_path: Path) -> None:
    walker = only(replace(person, duration_s=1.0))
    times = np.linspace(0.0, 1.0, 31)
    local = np.stack([walker.sequence.joints(float(t)) for t in times])
    np.savez(tmp_path / "push.npz", positions=local, times=times, names=np.array(walker.joint_names))
    joints = replace(person, sources=(SourceSpec("joints", file=str(tmp_path / "push.npz")),))
    found = only(joints)
    (facing,) = making.actor_labels([found], recording_plans(joints)[""].simulation.radar, 0.0)["orientation"]
    assert np.degrees(facing) % 360.0 == pytest.approx(280.0, abs=15.0)
    assert np.hypot(*found.vertices(0.0)[:, :2].mean(axis=0)) == pytest.approx(2.0, abs=0.3)
    assert found.action == "clip: push"
    named = replace(joints.sources[0], options={"action": "push"})
    assert only(replace(joints, sources=(named,))).action == "push"
    with pytest.raises(ValueError, match="clips and joints are alone"):
        recording_plans(replace(joints, sources=joints.sources * 2))


def test_a_shipped_clip_is_a_source_by_its_name(person: RecordingSpec) -> None:
    clip = next(iter(MotionLibrary().actions["kick"]))
    source = read_source(SourceTable(clip=clip.name), Path, "auto", 1.0)
    assert (source.spec.file, source.actions, changes_freely(source)) == (clip.name, ("kick",), "")
    check_source_file(source)
    found = only(replace(person, sources=(source.spec,)))
    assert found.action == "kick"
    assert found.motion.translation.shape[0] == clip.frames
    with pytest.raises(ValueError, match=f"up belongs to a file, and '{clip.name}' is a shipped clip"):
        read_source(SourceTable(clip=clip.name, up="y"), Path, "auto", 1.0)
    with pytest.raises(ValueError, match="no shipped clip 'kik'"):
        check_source_file(read_source(SourceTable(clip="kik"), Path("/nowhere").joinpath, "auto", 1.0))


def test_the_action_of_a_mesh_is_its_file_or_what_its_source_names(spec: RecordingSpec, ball: Path) -> None:
    for given, action in ((None, "ball"), ("rolls", "rolls")):
        source = read_source(SourceTable(mesh=str(ball), material="metal", action=given), Path, "auto", 1.0)
        assert source.actions == (action,)
        (found,) = labels(replace(spec, sources=(source.spec,))).values()
        assert found["action"] == [action]
