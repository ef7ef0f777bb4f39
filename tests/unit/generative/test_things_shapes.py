"""Animals and things: closed meshes of the size of the real thing, smooth in time, different for every seed."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.generative.things.articulated import ArticulatedSequence, ThingPart
from rfgen_sionna.records import MeshSequence
from rfgen_sionna.scene import material

SIZES = {
    "dog": ((1.1, 1.9), (0.2, 0.4), (0.6, 1.1)),
    "cat": ((0.6, 1.0), (0.09, 0.2), (0.3, 0.5)),
    "horse": ((2.2, 3.4), (0.6, 0.9), (1.7, 2.6)),
    "bird": ((0.4, 0.8), (0.1, 1.1), (0.1, 0.7)),
    "car": ((4.2, 4.8), (1.8, 2.2), (1.4, 1.55)),
    "van": ((4.9, 5.7), (2.0, 2.4), (2.2, 2.5)),
    "bicycle": ((1.7, 1.8), (0.55, 0.9), (1.5, 1.9)),
    "drone": ((0.35, 0.6), (0.35, 0.6), (0.12, 0.3)),
    "fan": ((0.3, 0.4), (0.4, 0.5), (1.1, 1.5)),
    "robot_vacuum": ((0.33, 0.40), (0.33, 0.40), (0.09, 0.13)),
    "door": ((0.1, 1.0), (0.9, 1.1), (2.0, 2.1)),
    "curtain": ((0.05, 0.6), (1.2, 1.9), (2.2, 2.5)),
    "pram": ((0.9, 1.1), (0.6, 0.75), (0.95, 1.1)),
    "wheelchair": ((0.9, 1.2), (0.55, 0.7), (0.85, 1.09)),
    "corner_reflector": ((0.055, 0.07), (0.13, 0.15), (0.11, 0.13)),
}
"""Kind -> least and greatest length, width and height [m] in the middle of its first action."""
ON_THE_FLOOR = sorted(set(SIZES) - {"bird", "drone", "corner_reflector"})


def test_every_kind_has_a_size() -> None:
    assert set(SIZES) == set(rfgen.things())


@pytest.mark.parametrize("name", SIZES)
def test_parts_are_closed_and_of_the_size_of_the_real_thing(name: str) -> None:
    for seed in (0, 1):
        sequence = rfgen.Actor.thing(name, seed=seed).sequence
        assert isinstance(sequence, MeshSequence)
        points = sequence.vertices(1.1)
        size = np.ptp(points, axis=0)
        assert all(low <= length <= high for length, (low, high) in zip(size, SIZES[name], strict=True)), size
        for part in range(len(sequence.part_names)):
            mesh = trimesh.Trimesh(points, sequence.faces[sequence.face_parts == part], process=False)
            assert mesh.is_watertight, sequence.part_names[part]
            assert mesh.volume > 0.0
        if name in ON_THE_FLOOR:
            assert -0.03 < points[:, 2].min() < 0.06


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.slow] * (k % 3 > 0)) for k, each in enumerate(SIZES)]
)
def test_seeds_are_not_alike_and_repeat(name: str) -> None:
    first, again, other = (rfgen.Actor.thing(name, seed=seed).sequence.vertices(0.7) for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    if name != "corner_reflector":
        assert first.shape != other.shape or np.abs(first - other).max() > 1e-3


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(each, marks=[pytest.mark.slow] * (k % 3 > 0))
        for k, each in enumerate(sorted(set(SIZES) - {"drone", "fan"}))
    ],
)
def test_vertices_have_continuous_accelerations(name: str) -> None:
    """Second differences at half the step are a quarter: no vertex jumps, or starts with a jerk, in any action."""
    for action in rfgen.things()[name].actions:
        sequence = rfgen.Actor.thing(name, action=action, seed=1).sequence
        for t in (0.05, 0.8):
            h = 2e-3
            coarse, fine = (
                sequence.vertices(t + s) - 2.0 * sequence.vertices(t) + sequence.vertices(t - s) for s in (h, h / 2)
            )
            assert np.abs(coarse - 4.0 * fine).max() < 0.1 * np.abs(coarse).max() + 2e-6


def test_a_part_s_name_is_used_once() -> None:
    box = trimesh.creation.box()
    part = ThingPart("box", np.asarray(box.vertices), np.asarray(box.faces, np.int32), material("wood"))
    with pytest.raises(ValueError, match="each with its own name"):
        ArticulatedSequence([part, part])


def test_mistakes_are_refused_with_what_there_is() -> None:
    with pytest.raises(ValueError, match=r"unknown 'dron', did you mean 'drone'.*known are dog, cat"):
        rfgen.Actor.thing("dron")
    with pytest.raises(ValueError, match=r"action: 'fly' is none of a dog; it has walk, run"):
        rfgen.Actor.thing("dog", action="fly")
    with pytest.raises(ValueError, match=r"wings: a dog has no such parameter; it has height, girth"):
        rfgen.Actor.thing("dog", wings=2)
    with pytest.raises(ValueError, match=r"height: 3 for a dog .*allowed are 0.15 to 0.95"):
        rfgen.Actor.thing("dog", height=3)
    with pytest.raises(ValueError, match=r"speed: 3.0 m/s, but a dog whose action is 'sit' stays in place"):
        rfgen.Actor.thing("dog", action="sit", speed=3.0)
    with pytest.raises(ValueError, match=r"speed: 90.0 m/s for a car .*up to 60"):
        rfgen.Actor.thing("car", speed=90.0)
    with pytest.raises(ValueError, match=r"path: a fan .* stays in place"):
        rfgen.Actor.thing("fan", path=[(0, 0), (1, 0)])
    with pytest.raises(ValueError, match=r"position: .*the path gives the places"):
        rfgen.Actor.thing("car", path=[(5, 0), (9, 0)], position=(1, 0, 0))
