"""People from recorded joint positions: at their place, with their bones, no faster than they were."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, Rig, person
from rfgen_sionna.generative.bodies.fitted_body import fitted_body
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.joint_layouts import LAYOUTS, package_joints
from rfgen_sionna.generative.motion.joint_recording import record_joints
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, forward_kinematics, global_rotations

RATE = 30.0
SIZE = 1.06
"""Size of the recorded person relative to the mean adult."""
PLACE = np.array([2.5, -1.2, 0.0])
LIMBS = [f"{side}_{joint}" for side in ("left", "right")
         for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")]  # fmt: skip
Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From z up to y up, as cameras of a Kinect look along +x."""
CAMERA = np.diag([-1.0, -1.0, 1.0]) @ Y_UP
"""From z up to the axes of an image: x right, y down, z ahead."""


def recorded(action: str, duration: float = 4.0, noise: float = 0.0) -> FloatArray:
    """(frame, 22, 3) joints of a taller person at another place [m]."""
    motion = KinematicSource(RATE)(action, duration, 1)
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :22]
    return SIZE * places + PLACE + np.random.default_rng(0).normal(0.0, 1.0, places.shape) * noise


def in_layout(layout: str, places: FloatArray) -> FloatArray:
    """The 22 joints in the order of a layout; faces, hands and heels beside the joint that carries them."""
    names = LAYOUTS[layout]
    found = {k: joint for joint, k in package_joints(names).items()}
    out = np.empty((len(places), len(names), 3))
    for k in range(len(names)):
        joint = found.get(k, "head")
        side = joint.partition("_")[0]
        carrier = {"nose": "head", f"{side}_ear": "head", f"{side}_hand": f"{side}_wrist",
                   f"{side}_heel": f"{side}_ankle"}.get(joint, joint)  # fmt: skip
        shift = {"nose": [0.1, 0.0, 0.0], f"{side}_ear": [0.0, 0.07 if side == "left" else -0.07, 0.0],
                 f"{side}_heel": [-0.05, 0.0, -0.06]}.get(joint, [0.0, 0.0, 0.0])  # fmt: skip
        out[:, k] = places[:, JOINT[carrier]] + shift
    return out


@pytest.fixture(scope="module")
def body() -> Rig:
    return person(Phenotype(height=1.75), seed=0)


def joints_of(actor: Actor, times: FloatArray) -> FloatArray:
    """(time, 52, 3) joints of an actor in the world [m]."""
    return np.stack([actor.joints(float(t)) for t in times])


def speeds(places: FloatArray, rate: float) -> FloatArray:
    return np.linalg.norm(np.diff(places, axis=0), axis=-1) * rate


@pytest.mark.parametrize(
    "layout", [pytest.param(each, marks=[pytest.mark.slow] * (k % 3 > 0)) for k, each in enumerate(LAYOUTS)]
)
def test_a_body_follows_noisy_joints_of_every_layout(body: Rig, layout: str) -> None:
    true, seen = recorded("walk"), recorded("walk", noise=0.005)
    actor = Actor.from_joints(in_layout(layout, seen), layout=layout, frame_rate=RATE, body=body)
    times = np.arange(0.0, 4.0, 0.1)
    at = joints_of(actor, times)
    rows = [JOINT[name] for name in LIMBS]
    error = np.linalg.norm(at[:, rows] - true[np.round(times * RATE).astype(int)][:, rows], axis=-1)
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.95) < 0.03
    # the residual says so
    assert actor.residual is not None
    assert actor.residual.overall_median < 0.01
    assert set(LIMBS) <= set(actor.residual.median)
    assert "left_knee" in actor.report()


@pytest.mark.parametrize(
    "action", ["jumping_jacks", *(pytest.param(each, marks=pytest.mark.slow) for each in ("walk", "standing"))]
)
def test_nothing_moves_faster_than_the_person_did(body: Rig, action: str) -> None:
    true = recorded(action)
    actor = Actor.from_joints(recorded(action, noise=0.01), layout="smpl22", frame_rate=RATE, body=body)
    at = joints_of(actor, np.arange(len(true)) / RATE)
    for name in LIMBS:
        fastest, own = (np.quantile(speeds(p[:, JOINT[name]], RATE), 0.98) for p in (at, true))
        assert fastest < 1.2 * own + 0.06, name


def test_noisy_positions_on_any_body_keep_their_knees_still(body: Rig, tmp_path: Path) -> None:
    """Of somebody who stands, recorded with a noise of a centimetre and put on another body, whose feet are held."""
    np.save(tmp_path / "standing.npy", recorded("standing", noise=0.01)[::2] @ Y_UP.T)
    actor = Actor.from_motion(tmp_path / "standing.npy", frame_rate=0.5 * RATE, body=body)
    at = joints_of(actor, np.arange(0.0, actor.sequence.duration, 1.0 / 60.0))
    shins = [JOINT[f"{side}_{joint}"] for side in ("left", "right") for joint in ("knee", "ankle")]
    assert speeds(at[:, shins], 60.0).max() < 0.33


def test_bones_have_the_recorded_lengths(body: Rig) -> None:
    true = recorded("jumping_jacks")
    # another left upper arm than right one
    true[:, [JOINT["left_elbow"], JOINT["left_wrist"]]] += 0.1 * (
        true[:, [JOINT["left_elbow"]]] - true[:, [JOINT["left_shoulder"]]]
    )
    actor = Actor.from_joints(true, layout="smpl22", frame_rate=RATE, body=body)
    at = actor.joints(1.234)
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
        for side in ("left", "right"):
            i, j = JOINT[f"{side}_{a}"], JOINT[f"{side}_{b}"]
            own = np.median(np.linalg.norm(true[:, i] - true[:, j], axis=-1))
            assert np.linalg.norm(at[i] - at[j]) == pytest.approx(own, rel=0.01)
    assert actor.body is not None
    # skin and stature follow: the mean adult is 1.70 m tall
    assert actor.body.height == pytest.approx(1.70 * SIZE, abs=0.04)


def test_a_fitted_body_with_its_own_lengths_is_itself(body: Rig) -> None:
    same = fitted_body(body, body.skeleton.offsets[:22])
    np.testing.assert_allclose(same.vertices, body.vertices, atol=1e-9)
    # hips further inside, as some layouts have them, leave the skin where it was
    offsets = body.skeleton.offsets[:22].copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        offsets[JOINT[f"{side}_hip"], 1] -= sign * 0.03
        offsets[JOINT[f"{side}_knee"], 1] += sign * 0.03
    inside = fitted_body(body, offsets)
    np.testing.assert_allclose(inside.vertices, body.vertices, atol=5e-3)
    np.testing.assert_allclose(inside.skeleton.offsets[:22], offsets)


def test_the_person_stands_on_the_floor_where_it_was(body: Rig) -> None:
    camera = recorded("standing") - [0.0, 0.0, 1.0]  # coordinates of a camera 1 m over the floor
    actor = Actor.from_joints(camera, layout="smpl22", frame_rate=RATE, body=body)
    assert actor.position[2] == pytest.approx(-1.0, abs=0.03)
    np.testing.assert_allclose(actor.joints(1.0)[JOINT["pelvis"]], camera[30, 0], atol=0.01)
    assert actor.vertices(1.0)[:, 2].min() == pytest.approx(actor.position[2], abs=0.01)
    raised = Actor.from_joints(
        camera, layout="smpl22", frame_rate=RATE, body=body, position=(0, 0, 1), orientation=(np.pi / 2, 0, 0)
    )
    np.testing.assert_allclose(raised.joints(1.0)[JOINT["pelvis"]], camera[30, 0][[1, 0, 2]] * [-1, 1, 1] + [0, 0, 1],
                               atol=0.01)  # fmt: skip
    ground = Actor.from_joints(camera, layout="smpl22", frame_rate=RATE, body=body, floor=0.0)
    assert ground.vertices(1.0)[:, 2].min() == pytest.approx(0.0, abs=0.01)


def test_a_phenotype_is_drawn_with_the_recorded_stature() -> None:
    actor = Actor.from_joints(
        recorded("standing", 1.0), layout="smpl22", frame_rate=RATE, body=Phenotype(age=40), seed=2
    )
    assert actor.body is not None
    assert actor.body.height == pytest.approx(1.70 * SIZE, abs=0.04)
    assert actor.motion is not None
    assert actor.sequence.duration == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("up", "turn"), [("y", Y_UP), ("-y", CAMERA), ("x", Y_UP[[1, 2, 0]])])
def test_up_turns_the_data(up: str, turn: FloatArray) -> None:
    data = recorded("walk")
    made = record_joints(data @ turn.T, layout="smpl22", frame_rate=RATE, up=up).positions
    straight = record_joints(data, layout="smpl22", frame_rate=RATE).positions
    np.testing.assert_allclose(made[..., 2], straight[..., 2], atol=1e-9)
    if up != "x":
        np.testing.assert_allclose(made, straight, atol=1e-9)  # what a camera looks along is x
    with pytest.raises(ClipError, match=f"stands with up='{up}'"):
        record_joints(data @ turn.T, layout="smpl22", frame_rate=RATE)


def test_a_wrong_axis_is_refused_with_the_right_one(caplog: pytest.LogCaptureFixture) -> None:
    data = recorded("walk")
    with pytest.raises(ClipError, match="head is below the feet with up='-z'; the person stands with up='z'"):
        record_joints(data, layout="smpl22", frame_rate=RATE, up="-z")
    with pytest.raises(ClipError, match="up: 'north'"):
        record_joints(data, layout="smpl22", frame_rate=RATE, up="north")
    # who lies is taken, where it is said
    lying = data @ Y_UP.T
    record_joints(lying, layout="smpl22", frame_rate=RATE, up="z")
    assert "up='y' would stand" in caplog.text
    with pytest.raises(ClipError, match="left-handed axes"):
        record_joints(data * [1.0, -1.0, 1.0], layout="smpl22", frame_rate=RATE)


def test_uneven_times_and_gaps() -> None:
    true = recorded("walk")
    rng = np.random.default_rng(1)
    kept = np.sort(rng.choice(len(true), 90, replace=False))
    kept[0] = 0
    times = 1000.0 + kept / RATE
    data = true[kept]
    data[40:45, JOINT["left_wrist"]] = np.nan
    data[50, JOINT["left_wrist"]] += 2.0  # a glitch
    made = record_joints(data, layout="smpl22", times=times)
    index = np.round(np.arange(len(made.positions)) / made.frame_rate * RATE).astype(int)
    error = np.linalg.norm(made.positions[index < len(true)] - true[index[index < len(true)]], axis=-1)
    assert np.quantile(error, 0.95) < 0.04
    assert error.max() < 0.15
    gone = true.copy()
    gone[30:60, JOINT["left_wrist"]] = np.nan
    with pytest.raises(ClipError, match=r"left_wrist: missing from .* s to .* s.*cut the clip"):
        record_joints(gone, layout="smpl22", frame_rate=RATE)
    assert len(record_joints(gone, layout="smpl22", frame_rate=RATE, longest_gap=1.0).positions) == len(true)
    with pytest.raises(ClipError, match="frame 2 at 0 s is not after"):
        record_joints(true[:3], layout="smpl22", times=[0.0, 0.1, 0.0])
    with pytest.raises(ClipError, match="1e-3 if these are ms"):
        record_joints(true[:3], layout="smpl22", times=[0.0, 33.0, 66.0])
    with pytest.raises(ClipError, match="one finite time"):
        record_joints(true[:3], layout="smpl22", times=[0.0, 0.1])
    with pytest.raises(ClipError, match=r"frame_rate= .* or times="):
        record_joints(true, layout="smpl22")


def test_units_shapes_and_layouts_are_checked() -> None:
    data = recorded("walk", 1.0)
    with pytest.raises(ClipError, match=r"looks like millimetres: scale=0\.001"):
        record_joints(1e3 * data, layout="smpl22", frame_rate=RATE)
    made = record_joints(1e3 * data, layout="smpl22", frame_rate=RATE, scale=1e-3)
    np.testing.assert_allclose(made.positions, record_joints(data, layout="smpl22", frame_rate=RATE).positions)
    for bad, message in (
        (data[..., :2], "2-D key points"),
        (
            np.concatenate([500.0 * data[..., :2], np.full((*data.shape[:2], 1), 0.9)], axis=-1),
            "key points in an image",
        ),
        (data[:, :21], r"allowed for these 22 joints is \(frame, 22, 3\)"),
        (data[0, 0], "allowed is"),
        (np.empty((0, 22, 3)), "no frames"),
        (data * np.nan, "missing|no finite"),
        (in_layout("kinect_v2", data)[:, np.r_[0:8, 8:12, 16:20, 12:16, 20:22]], "not the joints of one body"),
        ("joints.fbx", "no file"),
        (None, "an array"),
        (np.broadcast_to(data[:, :1], data.shape), "joints coincide"),
    ):
        with pytest.raises((ClipError, FileNotFoundError), match=message):
            record_joints(bad, layout="smpl22", frame_rate=RATE)
    with pytest.raises(ClipError, match="allowed are kinect_v2"):
        record_joints(data, layout="kinect3", frame_rate=RATE)
    with pytest.raises(ClipError, match="layout='smpl22'"):
        record_joints(data, frame_rate=RATE)
    with pytest.raises(ClipError, match="recognised as left_knee"):
        record_joints(data, names=[n.replace("left_knee", "tail") for n in JOINT_NAMES[:22]], frame_rate=RATE)
    with pytest.raises(ClipError, match="one of the two"):
        record_joints(data, layout="smpl22", names=JOINT_NAMES[:22], frame_rate=RATE)


def test_a_body_goes_without_ears_and_toes_that_are_out_of_sight(caplog: pytest.LogCaptureFixture) -> None:
    data = in_layout("body25", recorded("walk", 2.0))
    names = LAYOUTS["body25"]
    data[10:50, names.index("LEar")] = 0.0  # as detectors write it
    data[:, names.index("RBigToe")] = np.nan
    made = record_joints(data, layout="body25", frame_rate=RATE)
    assert "left_ear: missing from" in caplog.text
    assert "it is left out" in caplog.text
    assert "right_foot" not in made.measured
    # the foot points ahead of its ankle, where the other one does
    ahead = made.positions[:, [JOINT["left_foot"], JOINT["right_foot"]], 0] - made.positions[:, [7, 8], 0]
    assert np.median(np.abs(ahead[:, 0] - ahead[:, 1])) < 0.06
    assert np.abs(ahead).max() > 0.1
    data[10:50, names.index("LKnee")] = 0.0
    with pytest.raises(ClipError, match="left_knee: missing from"):
        record_joints(data, layout="body25", frame_rate=RATE)


def test_other_layouts_and_images_are_no_bodies() -> None:
    data = recorded("walk", 1.0)
    for made, taken in (("body25", "kinect25"), ("kinect25", "body25"), ("h36m17", "coco17"), ("coco17", "h36m17")):
        with pytest.raises(ClipError, match=r"check layout|joints coincide"):
            record_joints(in_layout(made, data), layout=taken, frame_rate=RATE)
    image = in_layout("mediapipe33", data - data[:, :1]) @ CAMERA.T / 2.2 + [0.5, 0.5, 0.0]
    with pytest.raises(ClipError, match="pose_world_landmarks"):
        record_joints(image, layout="mediapipe33", frame_rate=RATE, up="-y")


def test_several_people_and_confidences() -> None:
    one, other = recorded("walk", 2.0), recorded("standing", 2.0)[: len(recorded("walk", 2.0))]
    count = min(len(one), len(other))
    both = np.stack([one[:count], other[:count]], axis=1)
    with pytest.raises(ClipError, match="2 people; index= says which"):
        record_joints(both, layout="smpl22", frame_rate=RATE)
    made = record_joints(both, layout="smpl22", frame_rate=RATE, index=1)
    np.testing.assert_allclose(made.positions, record_joints(other[:count], layout="smpl22", frame_rate=RATE).positions)
    with pytest.raises(ClipError, match="move the axes"):
        record_joints(np.moveaxis(both, -1, 0), layout="smpl22", frame_rate=RATE)
    # a wrist that nobody sees counts for nothing
    states = np.full((*one.shape[:2], 1), 2.0)
    states[20:30, JOINT["left_wrist"]] = 0.0
    wrong = one.copy()
    wrong[20:30, JOINT["left_wrist"]] = [0.0, 5.0, 0.0]
    made = record_joints(np.concatenate([wrong, states], axis=-1), layout="smpl22", frame_rate=RATE)
    assert np.linalg.norm(made.positions - one, axis=-1).max() < 0.12
    with pytest.raises(ClipError, match="fourth column goes from"):
        record_joints(np.concatenate([one, 37.0 * states], axis=-1), layout="smpl22", frame_rate=RATE)


def test_hips_at_the_origin_get_their_height_from_the_feet(body: Rig, caplog: pytest.LogCaptureFixture) -> None:
    data = recorded("jumping_jacks")
    hips = 0.5 * (data[:, [JOINT["left_hip"]]] + data[:, [JOINT["right_hip"]]])
    actor = Actor.from_joints(in_layout("mediapipe33", (data - hips) @ CAMERA.T), layout="mediapipe33", up="-y",
                              frame_rate=RATE, body=body)  # fmt: skip
    assert "the hips are the origin" in caplog.text
    lowest = [actor.vertices(t)[:, 2].min() for t in np.arange(0.5, 3.5, 0.25)]
    assert max(map(abs, lowest)) < 0.04


def test_a_tilted_camera_is_told(body: Rig, caplog: pytest.LogCaptureFixture) -> None:
    data = recorded("walk_straight")
    Actor.from_joints(data, layout="smpl22", frame_rate=RATE, body=body)
    assert "degrees along the way" not in caplog.text
    tilted = data @ Rotation.from_euler("y", 4.0, degrees=True).as_matrix().T
    Actor.from_joints(tilted, layout="smpl22", frame_rate=RATE, body=body)
    assert re.search(r"the floor rises by [34]\.\d degrees along the way, towards \(-1\.00, ", caplog.text)


def test_files_of_joints(tmp_path: Path) -> None:
    data = in_layout("kinect25", recorded("walk", 2.0))
    names = LAYOUTS["kinect25"]
    wanted = record_joints(data, layout="kinect25", frame_rate=RATE).positions
    times = np.arange(len(data)) / RATE

    def csv(header: list[str], columns: FloatArray) -> Path:
        path = tmp_path / "joints.csv"
        np.savetxt(path, columns, delimiter=",", header=",".join(header), comments="", fmt="%.9f")
        return path

    planar = np.moveaxis(data, 2, 1).reshape(len(data), -1)
    header = [f"{name}_{axis}" for axis in "XYZ" for name in names]
    np.testing.assert_allclose(record_joints(csv(header, planar), frame_rate=RATE).positions, wanted, atol=1e-6)
    # by joint, with a clock in milliseconds and names in another style
    header = ["timestamp_ms", *(f"{name}.{axis}" for name in names for axis in "xyz")]
    path = csv(header, np.column_stack([1e3 * times, data.reshape(len(data), -1)]))
    np.testing.assert_allclose(record_joints(path).positions, wanted, atol=1e-3)
    with pytest.raises(ClipError, match="layout= or names="):
        record_joints(csv([f"{axis}{k}" for k in range(25) for axis in "xyz"], data.reshape(len(data), -1)),
                      frame_rate=RATE)  # fmt: skip
    numbered = record_joints(tmp_path / "joints.csv", layout="kinect25", frame_rate=RATE)
    np.testing.assert_allclose(numbered.positions, wanted, atol=1e-6)
    with pytest.raises(ClipError, match="x and y only"):
        record_joints(csv([f"{n}_{a}" for n in names for a in "xy"], data[..., :2].reshape(len(data), -1)))
    # one joint a row
    rows = [f"{t:.6f},{name},{x:.9f},{y:.9f},{z:.9f},0.9" for t, frame in zip(times, data, strict=True)
            for name, (x, y, z) in zip(names, frame, strict=True)]  # fmt: skip
    (tmp_path / "rows.csv").write_text("time,joint,x,y,z,visibility\n" + "\n".join(rows[3:]))
    made = record_joints(tmp_path / "rows.csv")
    np.testing.assert_allclose(made.positions[2:], wanted[2 : len(made.positions)], atol=0.01)
    np.savez(tmp_path / "joints.npz", positions=data, names=names, times=times)
    np.testing.assert_allclose(record_joints(tmp_path / "joints.npz").positions, wanted, atol=1e-6)
    np.save(tmp_path / "flat.npy", planar)
    with pytest.raises(ClipError, match="columns='planar'"):
        record_joints(tmp_path / "flat.npy", layout="kinect25", frame_rate=RATE)
    flat = record_joints(tmp_path / "flat.npy", layout="kinect25", frame_rate=RATE, columns="planar")
    np.testing.assert_allclose(flat.positions, wanted)
    walk = recorded("walk", 2.0)[::2] @ Y_UP.T
    results = {"motion": np.moveaxis(walk, 0, -1)[None], "lengths": np.array([len(walk)]), "text": ["a walk"]}
    np.save(tmp_path / "results.npy", np.array(results, object), allow_pickle=True)
    made = record_joints(tmp_path / "results.npy")
    assert made.positions[0, 0] == pytest.approx(recorded("walk", 2.0)[0, 0], abs=0.01)
    for name, content in (
        ("a.csv", ""),
        ("b.csv", "a,b\n1,2\n"),
        ("c.csv", "Head_X,Head_Y,Head_Z\n1,2\n"),
        ("d.json", "{}"),
    ):
        (tmp_path / name).write_text(content)
        with pytest.raises(ClipError, match=name):
            record_joints(tmp_path / name, frame_rate=RATE)


def test_names_come_in_any_order() -> None:
    order = np.random.default_rng(3).permutation(22)
    data = recorded("standing", 1.0)
    made = record_joints(data[:, order], names=[JOINT_NAMES[k] for k in order], frame_rate=RATE)
    leg = np.linalg.norm(made.positions[0, JOINT["left_hip"]] - made.positions[0, JOINT["left_knee"]])
    assert leg == pytest.approx(SIZE * MEAN_ADULT.length("left_knee"), rel=1e-3)
