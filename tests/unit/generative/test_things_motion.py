"""Animals and things move as real ones: wheels roll, feet stay where they stand, rotors and doors turn."""

from __future__ import annotations

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.driving import Drive
from rfgen_sionna.generative.things.cycling import JOINTS


def part_of(actor: rfgen.Actor, *names: str) -> FloatArray:
    """Vertices of the parts whose names begin so."""
    chosen = [k for k, name in enumerate(actor.part_names) if name.startswith(names)]
    assert chosen
    return np.unique(actor.sequence.faces[np.isin(actor.face_parts, chosen)])


def velocities(actor: rfgen.Actor, t: float, vertices: FloatArray, step: float = 1e-5) -> FloatArray:
    """(vertex, 3) world velocities [m/s]."""
    return (actor.vertices(t + step) - actor.vertices(t - step))[vertices] / (2 * step)


@pytest.mark.parametrize(
    ("name", "wheel", "speed"),
    [
        ("car", "front left wheel", 9.0), ("van", "rear right wheel", 12.0), ("bicycle", "front wheel", 5.0),
        ("pram", "rear left wheel", 1.1), ("wheelchair", "left wheel", 0.9), ("robot_vacuum", "right wheel", 0.3),
    ],
)  # fmt: skip
def test_wheels_roll_without_slipping(name: str, wheel: str, speed: float) -> None:
    """The tread is at rest on the floor and goes at twice the speed at the top."""
    actor = rfgen.Actor.thing(name, speed=speed, position=(9, 0, 0), seed=2)
    rubber = part_of(actor, wheel)
    places = actor.vertices(0.3)[rubber]
    speeds = np.linalg.norm(velocities(actor, 0.3, rubber), axis=1)
    radius = 0.5 * np.ptp(places[:, 2])
    assert speeds[places[:, 2].argmin()] < 0.12 * speed
    assert speeds.max() == pytest.approx(2 * speed, rel=0.01)
    # v² = 2 w² r (r + z) of a rolling wheel, z from its hub, at the radius of the tread
    tread = np.hypot(*(places - places.mean(axis=0))[:, ::2].T) > 0.98 * radius
    assert np.allclose(
        speeds[tread] ** 2, 2 * speed**2 * (places[tread, 2] - places[:, 2].min()) / radius, atol=0.1 * speed**2
    )


def test_wheels_follow_a_path_with_ramps() -> None:
    """After any way the wheel has turned by the way over its radius."""
    drive = Drive([(10.0, 0.0), (4.0, 0.0), (2.0, 3.0)], 3.0, ramp=1.0)
    actor = rfgen.Actor.thing("car", path=drive)
    assert actor.pose(0.0)[0][:2] == pytest.approx([10.0, 0.0])
    assert actor.pose(drive.duration)[0][:2] == pytest.approx([2.0, 3.0])
    wheel = part_of(actor, "front left wheel, metal")
    local = actor.sequence.vertices
    centre = local(0.0)[wheel].mean(axis=0)
    for t in (0.4, 1.7):
        start, now = ((local(s)[wheel] - centre)[:, [0, 2]] for s in (0.0, t))
        turned = np.angle(np.sum((now[:, 0] + 1j * now[:, 1]) * (start[:, 0] - 1j * start[:, 1])))
        assert np.exp(-1j * drive.travelled(t) / 0.32) == pytest.approx(np.exp(1j * turned), abs=1e-3)
    still = velocities(actor, drive.duration + 1.0, np.arange(50))
    assert np.abs(still).max() < 1e-9


def test_rotors_turn_in_both_senses_at_the_given_rate() -> None:
    actor = rfgen.Actor.thing("drone", position=(3, 0, 1.5), turns_per_second=90.0, rotor_diameter=0.24, drift=0.0)
    for number, sense in ((1, 1), (2, -1), (3, 1), (4, -1)):
        blades = part_of(actor, f"rotor {number}")
        speed = velocities(actor, 0.1, blades)
        assert np.linalg.norm(speed, axis=1).max() == pytest.approx(2 * np.pi * 90.0 * 0.12, rel=0.02)
        arms = actor.vertices(0.1)[blades] - actor.vertices(0.1)[blades].mean(axis=0)
        assert np.sign(np.cross(arms, speed)[:, 2].sum()) == sense
    assert rfgen.Actor.thing("drone").pose(0.0)[0][2] == 1.5


def test_blades_push_the_air_one_way() -> None:
    """Leading edges are above trailing ones on all rotors, or they would not lift."""
    actor = rfgen.Actor.thing("drone", drift=0.0, seed=5)
    for number in (1, 2, 3, 4):
        blades = part_of(actor, f"rotor {number}")
        speed = velocities(actor, 0.0, blades)
        place = actor.vertices(0.0)[blades]
        far = np.linalg.norm((place - place.mean(axis=0))[:, :2], axis=1) > 0.05
        ahead = []
        for side in (1, -1):  # the two blades, whose tips go opposite ways
            mean = speed[far].mean(axis=0) if side == 0 else speed[far][np.argmax(speed[far] @ speed[far][0] * side)]
            one = far & (speed @ mean > 0.5 * mean @ mean)
            along = place[one] @ mean
            ahead.append(np.polyfit(along, place[one][:, 2], 1)[0])
        assert min(ahead) > 0.0


def test_a_fan_turns_and_its_tips_have_their_speed() -> None:
    actor = rfgen.Actor.thing("fan", turns_per_second=20.0, diameter=0.4)
    assert np.linalg.norm(velocities(actor, 0.2, part_of(actor, "blades")), axis=1).max() == pytest.approx(
        2 * np.pi * 20.0 * 0.2, rel=0.05
    )
    assert np.abs(velocities(actor, 0.2, part_of(actor, "stand", "cage"))).max() < 1e-6
    off = rfgen.Actor.thing("fan", action="stand")
    assert np.array_equal(off.vertices(0.0), off.vertices(0.3))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_door_opens_towards_its_front_by_the_angle(seed: int) -> None:
    """The edge goes fastest in the middle: 15/8 of the mean rate of a minimum-jerk swing."""
    wanted = {"angle_deg": 80.0, "seconds": 2.0, "start": 0.5, "width": 0.9}
    actor = rfgen.Actor.thing("door", seed=seed, orientation=(0, 0, 0), position=(0, 0, 0), **wanted)
    leaf = part_of(actor, "leaf, painted wood")
    edge = leaf[np.abs(actor.vertices(0.0)[leaf][:, 1] - actor.vertices(9.0)[leaf][:, 1]) > 0.5]
    assert np.linalg.norm(velocities(actor, 1.5, edge), axis=1).max() == pytest.approx(
        15 / 8 * np.radians(80.0) / 2.0 * 0.9, rel=0.01
    )
    assert np.abs(velocities(actor, 0.4, leaf)).max() < 1e-9
    assert actor.vertices(9.0)[edge][:, 0].max() == pytest.approx(0.9 * np.sin(np.radians(80.0)), abs=0.02)
    shut = rfgen.Actor.thing("door", action="close", seed=seed, orientation=(0, 0, 0), position=(0, 0, 0), **wanted)
    assert np.allclose(shut.vertices(9.0), actor.vertices(0.0), atol=1e-9)


def test_a_curtain_swings_as_a_hanging_chain() -> None:
    """Its hem has the set deflection and the period 2 pi / 1.2024 sqrt(length / g); the rail is at rest."""
    actor = rfgen.Actor.thing("curtain", sway=0.1, length=2.3, width=1.4, position=(0, 0, 0), orientation=(0, 0, 0))
    t = np.linspace(0.0, 300.0, 6001)
    places = actor.vertices(0.0)
    hem = int(places[:, 2].argmin())
    path = np.array([actor.sequence.vertices(s)[hem, 0] for s in t[:3000]])
    assert path.std() == pytest.approx(0.1, rel=0.25)
    spectrum = np.abs(np.fft.rfft((path - path.mean()) * np.hanning(len(path))))
    rate = np.fft.rfftfreq(len(path), t[1])[spectrum.argmax()]
    assert rate == pytest.approx(1.2024 * np.sqrt(9.81 / 2.3) / (2 * np.pi), rel=0.16)
    top = places[:, 2] > 2.29
    assert np.abs(actor.vertices(1.0) - places)[top].max() < 1e-3


GAITS = [("dog", "walk"), ("dog", "sneak"), ("dog", "run"), ("cat", "walk"), ("horse", "walk"), ("horse", "trot"),
    ("horse", "gallop"), ("bird", "walk")]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "action"), [pytest.param(*each, marks=[pytest.mark.slow] * (k % 2)) for k, each in enumerate(GAITS)]
)
def test_feet_that_stand_do_not_slide(name: str, action: str) -> None:
    """The lowest toe is at rest: its median speed is under a tenth of the animal's, at any speed of the gait."""
    usual = rfgen.things()[name].actions[action].speed
    for factor in (None, 0.8):
        actor = rfgen.Actor.thing(name, action=action, speed=None if factor is None else factor * usual, seed=1)
        toes = [k for k, joint in enumerate(actor.joint_names) if joint.lower().rstrip("lr").rstrip("_").endswith(
            ("leg_tip", "leg_leaf", "toes_tip"))]  # fmt: skip
        assert len(toes) == (2 if name == "bird" else 4)
        pace = np.linalg.norm(actor.velocity)
        t = np.linspace(0.0, 2.0, 801)
        paths = np.stack([actor.joints(s)[toes] for s in t])
        speed = np.linalg.norm(np.diff(paths[..., :2], axis=0), axis=-1) / t[1]
        lowest = paths[1:, :, 2].argmin(axis=1)
        low = paths[1:, :, 2].min(axis=1) < paths[..., 2].min() + 0.1 * np.ptp(paths[..., 2])
        sliding = speed[np.arange(len(lowest)), lowest][low]
        assert np.median(sliding) < 0.1 * pace
        assert speed.max() > 1.5 * pace  # feet in the air overtake the body


def test_a_smaller_animal_is_slower_as_the_root_of_its_size() -> None:
    small, large = (rfgen.Actor.thing("dog", height=height) for height in (0.3, 0.6))
    assert np.linalg.norm(large.velocity) / np.linalg.norm(small.velocity) == pytest.approx(np.sqrt(2.0))
    assert rfgen.Actor.thing("cat").vertices(0.5)[:, 2].max() < 0.55


def test_wings_beat_at_the_given_rate() -> None:
    actor = rfgen.Actor.thing("bird", wing_beats_per_second=4.0)
    tip = actor.joint_names.index("wing_tip_L")
    t = np.linspace(0.0, 6.0, 1201)
    height = np.array([actor.sequence.joints(s)[tip, 2] for s in t])
    spectrum = np.abs(np.fft.rfft((height - height.mean()) * np.hanning(len(t))))
    assert np.fft.rfftfreq(len(t), t[1])[spectrum.argmax()] == pytest.approx(4.0, abs=0.3)


def test_riders_keep_their_bones_and_their_feet_on_the_pedals() -> None:
    actor = rfgen.Actor.thing("bicycle", speed=5.0, stature=1.8)
    for t in np.linspace(0.0, 1.0, 21):
        joints = actor.sequence.joints(t)
        for side in ("left", "right"):
            hip, knee, ankle = (joints[JOINTS.index(f"{side}_{name}")] for name in ("hip", "knee", "ankle"))
            assert np.linalg.norm(knee - hip) == pytest.approx(0.245 * 1.8, rel=0.01)
            assert np.linalg.norm(ankle - knee) == pytest.approx(0.246 * 1.8, rel=0.01)
            assert knee[0] > 0.5 * (hip[0] + ankle[0])
    # one turn of the pedals is 5 m of way
    assert np.allclose(actor.sequence.joints(0.0), actor.sequence.joints(1.0), atol=1e-6)


def test_actions_of_animals_begin_and_end_at_rest() -> None:
    actor = rfgen.Actor.thing("dog", action="fall_over")
    pelvis = actor.joint_names.index("Hips")
    assert np.abs(actor.joints(0.0) - actor.joints(-1.0)).max() < 1e-9
    assert np.abs(actor.joints(8.0) - actor.joints(20.0)).max() < 1e-9
    assert actor.joints(8.0)[pelvis, 2] < 0.4 * actor.joints(0.0)[pelvis, 2]


def test_a_dog_sits_down_and_stands_up() -> None:
    for action, first, last in (("sit_down", 0.42, 0.16), ("stand_up", 0.16, 0.42)):
        actor = rfgen.Actor.thing("dog", action=action, height=0.5)
        pelvis = actor.joint_names.index("Hips")
        assert actor.joints(0.0)[pelvis, 2] == pytest.approx(first, abs=0.04)
        assert actor.joints(3.0)[pelvis, 2] == pytest.approx(last, abs=0.04)
    assert rfgen.Actor.thing("dog", action="lie", height=0.5).vertices(1.0)[:, 2].max() < 0.4
