"""Falls of the motion library that physics made: true, in all directions, as fast as people's, at rest at the end."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative import MotionLibrary
from rfgen_sionna.generative.action_definitions import MotionSignals, check
from rfgen_sionna.generative.action_definitions.sampled_series import rate_of
from rfgen_sionna.generative.motion_library import LibraryClip

KINDS = ("trip", "forward", "backward", "left", "right", "slip", "faint", "from_chair", "sink")
Falls = dict[str, tuple[LibraryClip, MotionSignals]]


@pytest.fixture(scope="module")
def falls() -> Falls:
    library = MotionLibrary()
    return {clip.name: (clip, MotionSignals(library.motion(clip.name))) for clip in library if clip.kind == "simulated"}


def of_kind(falls: Falls, *kinds: str) -> Falls:
    return {name: each for name, each in falls.items() if name.removeprefix("sim_")[:-4] in kinds}


@pytest.mark.parametrize(
    "kinds", [("trip", "forward"), *((kind,) for kind in KINDS[2:])], ids=lambda kinds: "_and_".join(kinds)
)
def test_each_direction_has_forty_falls_of_different_bodies_from_different_starts(
    falls: Falls, kinds: tuple[str, ...]
) -> None:
    clips = [clip for clip, _ in of_kind(falls, *kinds).values()]
    assert len(clips) >= 40
    assert len({clip.subject for clip in clips}) >= 35
    assert len({clip.source for clip in clips}) >= (7 if kinds == ("from_chair",) else 10)


def test_every_one_shows_its_action(falls: Falls) -> None:
    for clip, signals in falls.values():
        assert check(signals, clip.action).reasons == ()
        assert 3.0 <= clip.duration <= 6.0


def test_people_who_fell_lie_still_on_the_floor(falls: Falls) -> None:
    for clip, s in falls.values():
        late = np.linalg.norm(rate_of(s.joints[-11:]), axis=-1)
        assert late.mean() < 0.05
        if clip.action != "sit_down_heavily":
            assert s.pelvis_height[-1] < 0.35
            assert s.head_height[-1] < 0.35
            # joints are as far over the floor as flesh is thick, hands and feet that lie on the body a little more
            assert s.joints[-1, :, 2].min() > 0.0
            assert np.median(s.joints[-1, :, 2]) < 0.25


def test_bodies_do_not_go_through_the_floor(falls: Falls) -> None:
    assert min(float(s.joints[..., 2].min()) for _, s in falls.values()) > -0.03


def test_they_fall_as_fast_as_people(falls: Falls) -> None:
    # Choi et al., Journal of Biomechanics 48 (2015) 911: 2.91 (SD 0.86) m/s of the head, 2.14 (0.63) m/s of the pelvis
    # at impact; on average within one standard deviation, each within two
    standing = of_kind(falls, "trip", "forward", "backward", "left", "right", "slip", "faint")
    head = np.array([-rate_of(s.head_height).min() for _, s in standing.values()])
    pelvis = np.array([-rate_of(s.pelvis_height).min() for _, s in standing.values()])
    assert head.min() > 1.19
    assert head.max() < 4.63
    assert abs(head.mean() - 2.91) < 0.86
    assert pelvis.min() > 0.88
    assert pelvis.max() < 3.40
    assert abs(pelvis.mean() - 2.14) < 0.63


def test_limbs_are_no_faster_than_those_of_people(falls: Falls) -> None:
    for _, s in falls.values():
        assert max(s.wrist_speed.max(), s.ankle_speed.max()) < 9.0


@pytest.mark.parametrize(("kind", "sign"), [("left", 1.0), ("right", -1.0)])
def test_who_falls_to_a_side_lands_on_that_side(falls: Falls, kind: str, sign: float) -> None:
    for _, s in of_kind(falls, kind).values():
        way = s.joint("neck")[-1] - s.joint("neck")[0]
        before = s.heading[12]
        assert sign * (np.cos(before) * way[1] - np.sin(before) * way[0]) > 0.2


def test_who_faints_does_not_reach_for_the_floor(falls: Falls) -> None:
    def spread(kind: str) -> float:
        out = []
        for _, s in of_kind(falls, kind).values():
            fast = int(np.argmin(rate_of(s.head_height)))
            out.append(s.wrist_speed[max(fast - 6, 0) : fast + 1].max())
        return float(np.median(out))

    assert spread("faint") < spread("backward")


def test_they_begin_with_motion_of_people(falls: Falls) -> None:
    # the real lead-in walks, stands or sits for at least half a second
    for _, s in falls.values():
        assert np.abs(rate_of(s.head_height)[:10]).max() < 1.0
    walks = of_kind(falls, "trip", "slip")
    assert min(s.speed[:10].max() for _, s in walks.values()) > 0.35
