"""Bodies: the person asked for, skinned as anny skins, labelled, and made into actors."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, PhenotypeError, animate, person
from rfgen_sionna.generative.bodies.anny_rig import load_model
from rfgen_sionna.generative.bodies.phenotype import LIMITS
from rfgen_sionna.generative.bodies.retarget import joint_rotations
from rfgen_sionna.generative.motion import JOINT_NAMES, KinematicSource
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.generative.prompts import PromptError
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import MeshSequence, Motion


@pytest.fixture(scope="module")
def rig():
    return person(Phenotype(gender="female", age=30, height=1.68), seed=0)


def test_attributes_in_natural_units_are_met():
    body = person(Phenotype(gender="male", age=40, height=1.83, weight=92), seed=0)
    assert body.height == pytest.approx(1.83, abs=2e-3)
    assert body.mass == pytest.approx(92, rel=0.01)
    for gender, height, weight in (
        ("male", 1.86, 62.0),
        ("male", 1.7, 98.0),
        ("female", 1.6, 86.0),
        ("female", 1.7, 50.0),
    ):
        body = person(Phenotype(gender=gender, age=30, height=height, weight=weight), seed=0)
        assert body.height == pytest.approx(height, abs=2e-3)
        assert body.mass == pytest.approx(weight, rel=0.01)
    child = person(Phenotype(age=6), seed=0)
    assert 0.95 < child.height < 1.4
    strong, weak = (person(Phenotype(gender="male", height=1.75, muscle=m), seed=0) for m in (0.9, 0.3))
    assert np.abs(strong.vertices - weak.vertices).max() > 0.02


def test_what_is_left_open_comes_from_the_seed():
    a, same, other = person(seed=1), person(seed=1), person(seed=2)
    np.testing.assert_array_equal(a.vertices, same.vertices)
    assert abs(a.height - other.height) > 1e-3
    # naming one attribute leaves the others as the seed drew them
    drawn = Phenotype().complete(4)
    assert Phenotype(muscle=drawn["muscle"], gender=drawn["gender"]).complete(4)["age"] == drawn["age"]
    genders = {Phenotype(height=1.7, weight=65).complete(seed)["gender"] for seed in range(5)}
    assert genders == {0.0, 1.0}


@pytest.mark.parametrize(("name", "limits"), LIMITS.items())
def test_values_out_of_range_are_refused(name, limits):
    for value in (limits[0] - 0.01, limits[1] + 0.01, float("nan")):
        with pytest.raises(PhenotypeError, match=f"{name}.*allowed"):
            Phenotype(**{name: value})


def test_a_body_out_of_reach_is_refused_with_what_is_in_reach():
    with pytest.raises(PhenotypeError, match=r"weight: 200 kg is out of reach.*allowed is \d"):
        Phenotype(gender="female", height=1.5, weight=200, age=30).complete(0)
    with pytest.raises(PhenotypeError, match="gender"):
        Phenotype(gender="tall")


def test_the_mesh_is_closed_faces_outwards_and_stands_on_its_feet(rig):
    mesh = trimesh.Trimesh(rig.vertices, rig.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.03
    assert rig.faces.shape == (27420, 3)
    # facing +x: toes before heels, nose before the back of the head; left at +y
    feet = rig.vertices[np.unique(rig.faces[rig.face_parts == rig.part_names.index("left_foot")])]
    ankle = rig.heads[rig.bone_names.index("foot.L")]
    assert feet[:, 0].max() - ankle[0] > 0.12 > ankle[0] - feet[:, 0].min()
    assert ankle[1] > 0.05


def test_every_part_is_where_its_name_says(rig):
    pose = animate(rig, KinematicSource()("t_pose", 0.5, 0, skeleton=rig.skeleton))
    v, centre = pose.vertices(0.0), {}
    for k, name in enumerate(rig.part_names):
        centre[name] = v[rig.faces[rig.face_parts == k]].mean(axis=(0, 1))
    assert len(rig.part_names) == 14
    assert centre["head"][2] > centre["torso"][2] > centre["left_thigh"][2] > centre["left_shank"][2]
    assert centre["left_shank"][2] > centre["left_foot"][2]
    y = [centre[f"left_{p}"][1] for p in ("upper_arm", "forearm", "hand")]
    assert 0.1 < y[0] < y[1] < y[2]
    np.testing.assert_allclose(centre["right_hand"][1], -y[2], atol=0.12)


def test_skinning_is_anny_s_own(rig):
    """The oracle is anny's torch model, posed by the world poses of the same bones."""
    import torch

    model = load_model()
    parameters = Phenotype(gender="female", age=30, height=1.68).complete(0)
    sequence = animate(rig, KinematicSource()("pick_up", 2.0, 1, skeleton=rig.skeleton))
    rotations, root = sequence.pose(1.3)
    # from our frame (x forwards, y left) to anny's (-y forwards, x left)
    ours_to_anny = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with torch.no_grad():
        rest = model(phenotype_kwargs=parameters)["rest_bone_poses"][0].numpy()
        poses = np.tile(np.eye(4), (len(rest), 1, 1))
        poses[:, :3, :3] = ours_to_anny @ rotations @ ours_to_anny.T @ rest[:, :3, :3]
        poses[:, :3, 3] = rig.bone_heads(rotations, root) @ ours_to_anny.T
        out = model(
            pose_parameters=torch.as_tensor(poses)[None], phenotype_kwargs=parameters, pose_parameterization="world"
        )
    np.testing.assert_allclose(sequence.vertices(1.3) @ ours_to_anny.T, out["vertices"][0].numpy(), atol=1e-9)


def test_the_skeleton_of_the_body_moves_as_the_motion_says(rig):
    motion = KinematicSource()("walk", 2.0, 0, skeleton=rig.skeleton)
    sequence = animate(rig, motion)
    assert isinstance(sequence, MeshSequence)
    assert sequence.duration == motion.duration
    assert sequence.joint_names == JOINT_NAMES
    for k in (0, 77, 200):
        t = k / motion.frame_rate
        joints = sequence.joints(t)
        np.testing.assert_allclose(joints[0], motion.translation[k], atol=1e-9)
        np.testing.assert_allclose(sequence.joint_rotations(t), joint_rotations(motion)[k], atol=1e-6)
        shin = np.linalg.norm(joints[JOINT["left_ankle"]] - joints[JOINT["left_knee"]])
        assert shin == pytest.approx(rig.skeleton.length("left_ankle"), abs=1e-9)
    # the first and the last pose are held outside
    np.testing.assert_array_equal(sequence.vertices(-1.0), sequence.vertices(0.0))
    np.testing.assert_array_equal(sequence.vertices(9.0), sequence.vertices(sequence.duration))


def test_a_motion_made_for_another_body_stands_on_the_floor(rig):
    foreign = KinematicSource(30.0)("walk", 3.0, 0)
    assert not np.allclose(foreign.offsets, rig.skeleton.offsets)
    sequence = animate(rig, foreign)
    for t in np.arange(0.0, 3.0, 0.05):
        assert -0.01 < sequence.vertices(t)[:, 2].min() < 0.02


def test_one_pose_is_a_still_body(rig):
    motion = KinematicSource()("standing", 1.0, 0, skeleton=rig.skeleton)
    still = Motion(
        motion.rotations[:1], motion.translation[:1], 30.0, motion.joint_names, motion.parents, motion.offsets
    )
    sequence = animate(rig, still)
    assert sequence.duration == 0.0
    np.testing.assert_array_equal(sequence.vertices(0.0), sequence.vertices(5.0))


def test_unknown_joints_are_refused(rig):
    motion = KinematicSource()("standing", 1.0, 0, skeleton=rig.skeleton)
    names = ("pelvis", "tail", *motion.joint_names[2:])
    with pytest.raises(ValueError, match="tail"):
        animate(rig, Motion(motion.rotations, motion.translation, 30.0, names, motion.parents, motion.offsets))


def test_an_actor_from_a_prompt_faces_the_radar_three_metres_away(rig):
    actor = Actor.from_prompt("a person in a T pose", seed=0, duration=0.5, body=rig)
    v = actor.vertices(0.2)
    assert actor.position == (3.0, 0.0, 0.0)
    np.testing.assert_allclose(actor.joints(0.2)[0, :2], [3.0, 0.0], atol=0.06)
    assert abs(v[:, 2].min()) < 0.01
    j = actor.joints(0.2)
    # facing -x: the person's left is at -y
    assert j[JOINT["left_wrist"], 1] < -0.5 < 0.5 < j[JOINT["right_wrist"], 1]
    assert j[JOINT["left_foot"], 0] < j[JOINT["left_ankle"], 0]
    assert (actor.material, actor.name, actor.motion.action) == ("skin", "person", "t_pose")
    assert actor.motion.prompt == "a person in a T pose"


def test_distance_orientation_and_body_come_from_the_prompt():
    actor = Actor.from_prompt("a man 1.9 m tall standing, facing away, at 2.2 m", seed=0, duration=0.5)
    assert actor.position[0] == pytest.approx(2.2)
    assert np.cos(actor.orientation[0]) == pytest.approx(1.0)
    assert actor.body.height == pytest.approx(1.9, abs=2e-3)
    assert actor.phenotype.gender == "male"


def test_the_place_before_a_radar_and_the_caller_s_own_place(rig):
    radar = Radar.load("awr1843", position=(1.0, 1.0, 1.0), look_at=(1.0, 5.0, 0.5))
    actor = Actor.from_prompt("a person standing at 2 m", seed=0, duration=0.5, body=rig, radar=radar)
    np.testing.assert_allclose(actor.position, [1.0, 3.0, 0.0], atol=1e-9)
    facing = [np.cos(actor.orientation[0]), np.sin(actor.orientation[0])]
    np.testing.assert_allclose(facing, [0.0, -1.0], atol=1e-9)
    placed = Actor.from_prompt(
        "a person standing", seed=0, duration=0.5, body=rig, position=(1, 2, 0), orientation=(0.5, 0, 0)
    )
    assert (placed.position, placed.orientation) == ((1.0, 2.0, 0.0), (0.5, 0.0, 0.0))


@pytest.mark.parametrize("bearing", [25.0, -40.0])
def test_the_azimuth_is_a_place_and_not_a_turn(rig, bearing):
    """Positive to the radar's left, at the same distance, and the person faces the radar from there."""
    radar = Radar.load("awr1843", position=(1.0, 1.0, 1.0), look_at=(4.0, 4.0, 0.5))
    prompt = f"a person standing at 2 m, at azimuth {bearing:g} degrees"
    actor = Actor.from_prompt(prompt, seed=0, duration=0.2, body=rig, radar=radar)
    offset = np.array(actor.position)[:2] - 1.0
    assert np.hypot(*offset) == pytest.approx(2.0)
    seen = np.append(offset, 0.0) @ radar.rotation
    assert np.degrees(np.arctan2(seen[1], seen[0])) == pytest.approx(bearing, abs=1.0)  # the radar looks down a little
    yaw = actor.orientation[0]
    np.testing.assert_allclose([np.cos(yaw), np.sin(yaw)], -offset / 2.0, atol=1e-9)


@pytest.mark.parametrize(("way", "sign"), [("towards", -1), ("away from", 1)])
def test_walking_towards_and_away_from_the_radar_goes_one_way(rig, way, sign):
    actor = Actor.from_prompt(f"a person walks {way} the radar", seed=2, duration=3.0, body=rig)
    hips = np.array([actor.joints(t)[0] for t in np.arange(0.0, 3.0, 0.05)])
    steps = np.diff(np.linalg.norm(hips[:, :2], axis=1))
    assert (sign * steps > 0.02).all()
    assert 0.5 * (hips[0, 0] + hips[-1, 0]) == pytest.approx(3.0, abs=0.15)
    assert re.search(r"path +\d\.\d m at", actor.report())


def test_a_walk_that_leads_to_the_radar_is_refused_with_what_fits(rig):
    def walk(distance: float, duration: float) -> Actor:
        prompt = f"a person walks towards the radar, at {distance:g} m"
        return Actor.from_prompt(prompt, seed=2, duration=duration, body=rig)

    with pytest.raises(
        ValueError, match=r"5 s at .* at most [\d.]+ s fit there, or take .* at least [\d.]+ m"
    ) as caught:
        walk(2.0, 5.0)
    time, distance = re.search(r"most ([\d.]+) s .* least ([\d.]+) m, or", str(caught.value)).groups()
    walk(2.0, float(time))
    walk(float(distance), 5.0)
    with pytest.raises(ValueError, match="walk"):
        walk(2.0, float(time) + 0.3)


def test_a_walk_too_short_to_come_back_says_so(rig, caplog):
    actor = Actor.from_prompt("a person walks back and forth", seed=0, duration=1.2, body=rig)
    assert "1.2 s are too short for the way back" in caplog.text
    assert "1.2 s are too short for the way back" in actor.report()
    caplog.clear()
    assert "forth and back" in Actor.from_prompt("a person walking", seed=0, duration=3.0, body=rig).report()
    assert not caplog.records


def test_the_report_names_the_body_that_was_drawn_and_every_origin(caplog):
    actor = Actor.from_prompt("a tall woman pulls, 40 years old, wearing a hat", seed=1, duration=0.2)
    decided = {d.name: (d.value, d.origin) for d in actor.decisions}
    assert decided["age"] == ("40 years", "from the prompt")
    assert decided["gender"] == ("female", "from the prompt")
    assert decided["height"] == (f"{actor.body.height:.2f} m", "drawn from tall (seed 1)")
    assert decided["weight"] == (f"{actor.body.mass:.0f} kg", "drawn from seed 1")
    assert decided["muscle"][1] == "drawn from seed 1"
    assert decided["hand"] == (actor.prompt.hand, "drawn from seed 1")
    assert decided["distance"] == ("3 m", "default")
    assert all(f"  {name}" in actor.report() for name in decided)
    assert caplog.text.count("hat") == 1
    wrist = np.array([actor.joints(t) for t in (0.0, 0.2)])
    moved = np.linalg.norm(np.diff(wrist, axis=0)[0], axis=-1)
    other = "right" if actor.prompt.hand == "left" else "left"
    assert moved[JOINT[f"{actor.prompt.hand}_wrist"]] > moved[JOINT[f"{other}_wrist"]]


def test_the_report_names_what_arguments_replace(rig):
    actor = Actor.from_prompt(
        "a man standing", seed=0, duration=0.2, body=rig, position=(1, 2, 0), orientation=(0.5, 0, 0), material="wood"
    )
    decided = {d.name: (d.value, d.origin) for d in actor.decisions}
    assert decided["position"] == ("(1, 2, 0) m", "from the argument position")
    assert decided["orientation"] == ("(0.5, 0, 0) rad", "from the argument orientation")
    assert decided["height"] == (f"{rig.height:.2f} m", "from the argument body")
    assert decided["material"] == ("wood", "from the argument material")
    assert not {"distance", "azimuth"} & decided.keys()
    mesh = Actor.from_motion(actor.motion, body=rig)
    with pytest.raises(ValueError, match="has no prompt"):
        mesh.report()


def test_a_motion_elsewhere_stays_there_on_another_body(rig):
    """Steps scale with the legs, the place does not."""
    motion = KinematicSource(20.0)("standing", 1.0, 1)
    there = replace(motion, translation=motion.translation + np.array([5.0, -3.0, 0.0]))
    taller = replace(there, offsets=1.2 * there.offsets)
    at = Actor.from_motion(taller, body=rig, position=(0, 0, 0), orientation=(0, 0, 0)).joints(0.5)[JOINT["pelvis"]]
    np.testing.assert_allclose(at[:2], [5.0, -3.0], atol=0.05)


def test_bad_prompts_and_durations_fail_before_the_body_is_built():
    with pytest.raises(PromptError):
        Actor.from_prompt("a xylophone")
    with pytest.raises(ValueError, match="duration"):
        Actor.from_prompt("a person walking", duration=-1.0)


def test_importing_actors_starts_neither_torch_nor_anny():
    code = (
        "import sys, rfgen_sionna.generative as g; g.Actor; g.ACTIONS; g.Phenotype(height=1.7); "
        "sys.exit(sum(m in sys.modules for m in ('torch', 'anny', 'mitsuba', 'diffusers')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("prompt", ["a thin muscular man standing", "a heavy muscular woman standing"])
def test_words_that_no_body_joins_give_way(prompt, caplog):
    """What words ask for is drawn: where weight and muscle don't meet, the weight is kept and the rest is said."""
    actors = [Actor.from_prompt(prompt, seed=seed, duration=0.2) for seed in range(3)]
    assert "the weight is kept" in caplog.text
    assert all(actor.phenotype is not None and actor.phenotype.weight is not None for actor in actors)
