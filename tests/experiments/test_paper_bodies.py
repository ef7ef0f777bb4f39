"""Sections 9 and 10 rebuilt: their sets have nothing in common, and their networks see what they should."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.paper.sets import check_disjoint, specs_of
from experiments.paper.stored_recipes import stored_recipe
from rfgen_sionna.recipes import RecordingSpec

torch = pytest.importorskip("torch")
pytest.importorskip("anny")

from experiments.paper import gestures, mesh_network, posture  # noqa: E402
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, MEAN_ADULT, NUM_BODY_JOINTS  # noqa: E402

POSTURE_SETS = ("narrow", "synthetic", *posture.TESTS)
"""Recipes of section 9."""
EXACT = "donot_use_mm_for_euclid_dist"
"""Distances of `torch.cdist` without products of matrices, which are 1 mm off."""


@cache
def parts(section: str, names: tuple[str, ...]) -> dict[str, list[RecordingSpec]]:
    """Recordings of each of a section's recipes."""
    return {name: specs_of(stored_recipe(f"{section}_{name}")) for name in names}


def actions(specs: list[RecordingSpec]) -> set[str]:
    """Prompts of the recordings."""
    return {spec.prompt for spec in specs}


@pytest.mark.parametrize(("section", "names"), [("posture", POSTURE_SETS), ("gestures", gestures.SETS)])
def test_training_and_tests_share_no_body_place_seed_or_clip(section: str, names: tuple[str, ...]) -> None:
    check_disjoint(parts(section, names))


def test_unseen_postures_and_new_gestures_are_none_of_the_measured_training() -> None:
    bodies, hands = parts("posture", POSTURE_SETS), parts("gestures", gestures.SETS)
    assert not actions(bodies["narrow"]) & actions(bodies["unseen_postures"])
    assert actions(bodies["narrow"]) == actions(bodies["unseen_places"]) == actions(bodies["unseen_people"])
    assert not actions(hands["measured"]) & actions(hands["new_test"])
    assert actions(hands["new_test"]) == actions(hands["new_synthetic"])


def test_tests_are_measured_ones_and_the_measured_training_is_narrow() -> None:
    for section, names in (("posture", POSTURE_SETS), ("gestures", gestures.SETS)):
        for name, specs in parts(section, names).items():
            assert {(spec.receiver or {}).get("mismatch") is None for spec in specs} == {"synthetic" in name}
    narrow = specs_of(stored_recipe("posture_narrow"))
    assert len({spec.bodies[0].seed for spec in narrow}) == 3
    assert {(spec.place, spec.distance_m, spec.azimuth_deg, spec.orientation_deg) for spec in narrow} == {
        ("free space", 2.5, 0.0, 0.0)
    }
    hands = parts("gestures", gestures.SETS)
    assert {spec.orientation_deg for spec in hands["measured"]} == {0.0}
    for name in ("synthetic", "test"):
        turned = [(spec.prompt, spec.orientation_deg) for spec in hands[name]]
        assert {turned.count(each) for each in turned} == {len(turned) // 24}  # six gestures, four orientations


def test_quick_recipes_are_the_same_with_fewer_recordings() -> None:
    whole, quick = stored_recipe("gestures_test"), stored_recipe("gestures_test", 6, 0.6)
    assert (quick.count, quick.tables.duration_s.values) == (6, (0.6,))
    assert quick.tables.seed == whole.tables.seed
    with pytest.raises(ValueError, match="cannot be read"):
        stored_recipe("nothing")


def test_shifted_images_lose_what_leaves_them() -> None:
    images = torch.arange(1.0, 1 + 4 * 6 * 6).reshape(4, 6, 6)
    draw = torch.Generator().manual_seed(2)
    for _ in range(20):
        moved = gestures._shifted(images, draw)
        assert moved.shape == images.shape
        assert set(moved.ravel().tolist()) <= {0.0, *images.ravel().tolist()}
        assert (moved == 0).sum() <= 4 * (36 - 16)


def pose_set(count: int, seed: int) -> mesh_network.BodySet:
    """Mean adults that stand before the radar; points are their joints, and tell where they are."""
    rng = np.random.default_rng(seed)
    root = np.array([2.5, 0.0, 0.0]) + rng.uniform(-0.4, 0.4, (count, 1, 3)) + np.zeros((count, 5, 3))
    joints = root[:, :, None] + MEAN_ADULT.rest_positions()[:NUM_BODY_JOINTS]
    points = np.zeros((count, 5, mesh_network.NUM_POINTS, 6))
    points[..., :3] = joints[:, :, np.arange(mesh_network.NUM_POINTS) % NUM_BODY_JOINTS]
    rotations = np.broadcast_to(np.eye(3), (count, 5, NUM_BODY_JOINTS, 3, 3))
    shape = rng.uniform(0, 1, (count, 2))
    return mesh_network.BodySet(*(torch.tensor(each, dtype=torch.float32) for each in (points, root, rotations, shape)))


def test_a_mirrored_or_turned_body_is_where_its_mirrored_or_turned_points_are() -> None:
    data = pose_set(8, 0)
    draw = torch.Generator().manual_seed(1)
    for change in (mesh_network._mirrored, mesh_network._turned):
        made = change(data, draw)
        joints = mesh_network._joints(made.rotations, made.root)
        nearest = torch.cdist(joints, made.points[..., :3], compute_mode=EXACT).amin(dim=-1)
        assert nearest.max() < 1e-5
        assert torch.allclose(torch.linalg.det(made.rotations), torch.ones(()), atol=1e-5)
    assert not torch.equal(mesh_network._mirrored(data, draw).points, data.points)


def test_rotations_relative_to_the_parents_of_a_turned_body_are_none_but_the_root_s() -> None:
    turn = mesh_network.rotations_of(torch.tensor([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])).double().numpy()
    local = mesh_network.local_rotations(np.broadcast_to(turn, (NUM_BODY_JOINTS, 3, 3)))
    np.testing.assert_allclose(local[0], turn)
    np.testing.assert_allclose(local[1:], np.broadcast_to(np.eye(3), (NUM_BODY_JOINTS - 1, 3, 3)), atol=1e-12)


def test_fingers_follow_their_wrists() -> None:
    followed = [JOINT_NAMES[number] for number in posture.FINGER_WRISTS]
    assert followed[:NUM_BODY_JOINTS] == list(JOINT_NAMES[:NUM_BODY_JOINTS])
    assert set(followed[NUM_BODY_JOINTS:]) == {"left_wrist", "right_wrist"}


@pytest.mark.slow
def test_a_network_finds_where_a_body_is() -> None:
    net = mesh_network.trained_net(pose_set(40, 0), 150, seed=0)
    test = pose_set(10, 1)
    with torch.no_grad():
        root, rotations, shape = net(test.points)
    assert (root - test.root).norm(dim=-1).mean() < 0.12  # places differ by 0.4 m
    assert (rotations - test.rotations).abs().max() < 0.2
    assert shape.shape == test.shape.shape


def spots(count: int, seed: int) -> gestures.GestureSet:
    """Spots that come nearer or recede, or go to the left or to the right, over noise."""
    rng = np.random.default_rng(seed)
    ways = {"pull": (2, 0), "push": (-2, 0), "swipe_left": (0, 2), "swipe_right": (0, -2)}
    names = [list(ways)[number % 4] for number in range(count)]
    images = 0.2 * rng.uniform(size=(count, 8, 32, 32))
    for number, name in enumerate(names):
        places = rng.integers(14, 18, 2) + np.arange(-4, 4)[:, None] * ways[name]
        for frame, (row, column) in enumerate(places):
            images[number, frame, row - 1 : row + 2, column - 1 : column + 2] = 1.0
    return gestures.GestureSet(torch.tensor(images, dtype=torch.float32), tuple(names), np.arange(count) % 2 * 30.0)


@pytest.mark.slow
def test_a_network_tells_ways_of_a_spot_apart() -> None:
    training, test = spots(48, 0), spots(24, 1)
    classes = sorted(set(training.gestures))
    runs = gestures._runs(training, test, classes, 25, 1, seed=0)
    turned, kinds = gestures._by_orientation(runs, test), gestures._by_gesture(runs, test)
    assert kinds["mean"] > 0.85
    assert set(turned["mean"]) == {"0", "30"}
    assert np.mean(list(turned["mean"].values())) == pytest.approx(kinds["mean"])
    assert sum(sum(row.values()) for row in turned["confusion"].values()) == len(test.gestures)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "main"), [("posture", posture.main), ("gestures", gestures.main)])
def test_quick_form_writes_a_whole_report(name: str, main: Callable[[Any], None], tmp_path: Path) -> None:
    main(["--quick", "--output", str(tmp_path)])
    result = json.loads((tmp_path / f"{name}.json").read_text())["result"]
    assert None not in result["targets"].values() or name == "gestures"
    if name == "posture":
        for errors in result["errors"].values():
            assert set(errors["ours"]) == {"V", "S", "Q", "T", "G"}
            assert 0 < errors["ours"]["S"] < 3
            assert 0 < errors["ours"]["Q"] < 180
    else:
        assert set(result["accuracy by orientation"]) == {"baseline", "ours", "synthetic alone"}
        assert 0 <= result["accuracy of new gestures"]["mean"] <= 1
