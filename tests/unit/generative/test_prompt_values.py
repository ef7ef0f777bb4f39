"""Numbers, ranges, manner and people in prompts: the same value in every wording, and no word lost in silence."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.prompts import PromptError, read_prompt
from rfgen_sionna.generative.prompts.human_nouns import is_human
from rfgen_sionna.generative.prompts.person_words import read_wanted
from rfgen_sionna.generative.prompts.vocabulary import FILLERS
from rfgen_sionna.generative.several_actors import read_prompts

quick = settings(deadline=None, max_examples=30)


def value_of(text: str, name: str) -> tuple[float, float]:
    """The one range of a quantity in a prompt."""
    low, high = read_wanted(text).reader.one(name)
    return low, high


@quick
@given(st.integers(30, 900))
def test_a_distance_is_the_same_in_every_wording(centimetres: int) -> None:
    metres = centimetres / 100.0
    for words in (
        f"at {metres} m",
        f"{metres} metres away",
        f"{metres} meters from the radar",
        f"at a distance of {centimetres} cm from the radar",
        f"{metres} m in front of the sensor",
        f"distance: {metres} m",
        f"at {metres / 0.3048:.6f} feet",
    ):
        for text in (f"a person jumps, {words}", f"{words}, a person jumps", f"a person jumps {words}, facing left"):
            assert value_of(text, "distance") == pytest.approx((metres, metres), abs=2e-3), text


@quick
@given(st.integers(5, 600))
def test_a_speed_is_the_same_in_every_unit(centimetres: int) -> None:
    speed = centimetres / 100.0
    for words in (
        f"at {speed} m/s",
        f"at a speed of {speed} m/s",
        f"at {speed} metres per second",
        f"with {3.6 * speed:.5f} km/h",
        f"at {3.6 * speed:.5f} kilometers per hour",
        f"at {speed / 0.44704:.6f} mph",
        f"at {centimetres} cm/s",
    ):
        assert value_of(f"a person walks {words}, 3 m away", "speed") == pytest.approx((speed, speed), abs=1e-3)


@quick
@given(st.integers(-90, 90))
def test_an_azimuth_is_the_same_in_every_wording(angle: int) -> None:
    side = "left" if angle >= 0 else "right"
    for words in (
        f"at azimuth {angle} degrees",
        f"at an azimuth of {angle}°",
        f"azimuth: {angle}",
        f"at a bearing of {abs(angle)} degrees to the {side}",
        f"{abs(angle)} degrees to the {side} of the boresight",
    ):
        assert value_of(f"a person jumps, {words}", "azimuth") == (angle, angle)


@pytest.mark.parametrize(
    ("words", "azimuth", "orientation"),
    [
        ("stands at 3 m, 30 degrees to the left", 30.0, None),
        ("stands 3 m from the radar and 30° right", -30.0, None),
        ("waves 2.5 m away, at an angle of 20 degrees to the left, turned 40 degrees to the right", 20.0, 320.0),
        ("stands at 3 m, turned 30 degrees to the left", None, 30.0),
        ("stands at 3 m, 30 degrees to her own left", None, 30.0),
        ("stands 30 degrees to the left of the radar, facing 20 degrees to the right", 30.0, 340.0),
    ],
)
def test_an_angle_after_a_distance_is_an_azimuth_and_one_of_somebody_an_orientation(
    words: str, azimuth: float | None, orientation: float | None
) -> None:
    said = read_prompt(f"a person {words}")
    assert (said.bearing_deg, said.orientation_deg, said.warnings) == (azimuth, orientation, ())


@pytest.mark.parametrize("subject", ["a person", "a dog"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_an_angle_that_may_be_either_is_an_orientation_with_a_warning(subject: str, side: str) -> None:
    said = read_prompts(f"{subject} stands 30 degrees to the {side}").said[0]
    assert said.orientation_deg == (30.0 if side == "left" else 330.0)
    for wording, value in (
        (f"turned 30 degrees to the {side}", (None, said.orientation_deg)),
        (f"30 degrees {side} of boresight", (30.0 if side == "left" else -30.0, None)),
    ):
        assert f"'{wording}'" in said.warnings[0]
        clear = read_prompts(f"{subject} stands {wording}").said[0]
        assert (clear.bearing_deg, clear.orientation_deg, clear.warnings) == (*value, ())


@pytest.mark.parametrize("path", ["~", "~nobody-at-all"])
def test_the_path_of_no_scene_is_refused(path: str) -> None:
    with pytest.raises(PromptError, match="environment: "):
        read_prompt(f"action: push, environment: {path}")


@quick
@given(st.integers(1, 300))
def test_repetitions_a_minute_are_the_same_in_every_wording(rate: int) -> None:
    for words in (
        f"{rate} times a minute",
        f"{rate} times per minute",
        f"{rate} times each minute",
        f"at {rate}/min",
        f"at a rate of {rate} times a minute",
        f"{rate / 60.0:.6f} times a second",
        f"at {rate / 60.0:.6f} Hz",
        f"every {60.0 / rate:.6f} seconds",
    ):
        assert value_of(f"a person waves {words}", "rate") == pytest.approx((rate, rate), rel=1e-2)


@quick
@given(st.integers(10, 80), st.integers(1, 60), st.integers(0, 10_000))
def test_a_range_is_drawn_from_within_by_the_seed(first: int, width: int, seed: int) -> None:
    low, high = first / 10.0, (first + width) / 10.0
    wordings = (
        f"at {low} to {high} m",
        f"at {low}-{high} m",
        f"between {low} and {high} m away",
        f"at a random distance between {low} and {high} m",
        f"from {low} m to {high} m away",
    )
    for words in wordings:
        assert value_of(f"a person jumps {words}", "distance") == pytest.approx((low, high))
    said = read_prompt(f"a person jumps {wordings[0]}", seed=seed)
    assert said.distance_m is not None
    assert low <= said.distance_m <= high
    assert said.origins["distance"] == f"drawn from {low:g} to {high:g} m (seed {seed})"


@pytest.mark.parametrize(
    ("words", "name", "low", "high"),
    [
        ("aged 20 to 30", "age", 20, 30),
        ("in her thirties", "age", 30, 39),
        ("1.6 to 1.8 m tall", "height", 1.6, 1.8),
        ("weighing 60-80 kg", "weight", 60, 80),
        ("facing a random direction", "orientation", 0, 360),
        ("with a random orientation", "orientation", 0, 360),
        ("randomly oriented", "orientation", 0, 360),
        ("turned 10 to 20 degrees to the right", "orientation", -20, -10),
        ("orientation between -45 and 45 degrees", "orientation", -45, 45),
        ("at a random azimuth between -30 and 30 degrees", "azimuth", -30, 30),
        ("at 0.5 to 1 m/s", "speed", 0.5, 1),
        ("breathing 12 to 15 times a minute", "breathing", 12, 15),
        ("heart rate 60-80", "heart", 60, 80),
    ],
)
def test_ranges_of_every_quantity(words: str, name: str, low: float, high: float) -> None:
    assert value_of(f"a person walks, {words}", name) == (low, high)


MANNERS: list[tuple[str, dict[str, Any]]] = [
    ("walks slowly", {"speed": 0.7}),
    ("walks at 0.5 m/s", {"speed_mps": 0.5}),
    ("walks slowly at 0.5 m/s", {"speed_mps": 0.5}),
    ("walks at 3 km/h", {"speed_mps": pytest.approx(0.8333, abs=1e-3)}),
    ("does small hops", {"amplitude": 0.6}),
    ("jumps high", {"amplitude": 1.4}),
    ("waves with big movements", {"amplitude": 1.4}),
    ("does squats 15 times a minute", {"rate": 15.0}),
    ("does 20 squats a minute", {"rate": 20.0}),
    ("waves every 2 seconds", {"rate": 30.0}),
    ("walks, tired", {"tired": True}),
    ("walks with arms hanging down", {"arm_posture": "hanging"}),
    ("walks with his hands on his hips", {"arm_posture": "on_hips"}),
    ("walks with arms folded", {"arm_posture": "folded"}),
    ("walks with her hands behind her back", {"arm_posture": "behind_back"}),
    ("walks with his hands in his pockets", {"arm_posture": "in_pockets"}),
    ("walks in a circle", {"path": "circle"}),
    ("runs in a circle", {"path": "circle"}),
    ("walks to and fro", {"path": "to_and_fro"}),
    ("walks back and forth", {"path": "to_and_fro"}),
    ("walks straight ahead", {"path": "straight"}),
    ("walks a loop around the room", {"path": "loop"}),
    ("walks around the room with pauses", {"path": "loop", "pauses": True}),
    ("walks, stopping now and then", {"pauses": True}),
]


@pytest.mark.parametrize(("words", "manner"), MANNERS)
def test_manner(words: str, manner: dict[str, Any]) -> None:
    said = read_prompt(f"a person {words}")
    assert said.unused == ()
    fields = {name: getattr(said.manner, name) for name in Manner.__dataclass_fields__}
    assert {name: value for name, value in fields.items() if value not in (None, False) and name != "hand"} == manner


def test_ways_as_the_radar_sees_them() -> None:
    for words, angle in (
        ("walks from left to right", 90.0),
        ("moves from the right to the left", 270.0),
        ("walks to his left", 90.0),
        ("walks radially", 0.0),
        ("walks back to the radar", 0.0),
        ("walks backwards away from the radar", 0.0),
        ("walks backwards, towards the radar", 180.0),
    ):
        assert read_prompt(f"a person {words}, 3 m away").orientation_deg == angle, words
    across = {read_prompt("a person walks tangentially", seed=seed).orientation_deg for seed in range(12)}
    assert across == {90.0, 270.0}
    assert read_prompt("a person walks while moving a hand in circles").manner.path is None
    with pytest.raises(PromptError, match="path: 'walks in a square' is no way"):
        read_prompt("a person walks in a square")


def test_a_manner_stands_in_the_report_and_in_the_negative_prompt() -> None:
    report = read_prompt("a tired person walks in a circle at 0.5 m/s with small steps and pauses").report()
    for line in ("speed         0.5 m/s", "amplitude", "path          circle", "with pauses", "tired         yes"):
        assert line in report
    with pytest.raises(PromptError, match="arm posture: the prompt asks for 'with arms folded'"):
        read_prompt("a person walks with arms folded", "arms folded")


@pytest.mark.parametrize(
    ("prompt", "unused"),
    [
        ("a person stands quickly", "quickly"),
        ("a person sits, repeatedly", "repeatedly"),
        ("a person sits down again and again", "again and again"),
        ("a person sidesteps to the left", "to the left"),
        ("a person walks 10 steps", "10 steps"),
        ("a person jumps 5 cm high", "5 cm high"),
        ("a person walks with the left hand", "with the left hand"),
        ("a blind man walks", "blind"),
        ("a person waves in a small office with two desks", "with two desks"),
    ],
)
def test_words_without_effect_are_named(prompt: str, unused: str) -> None:
    said = read_prompt(prompt)
    assert unused in said.unused
    assert f"prompt: '{unused}' was not understood and has no effect" in said.warnings


@pytest.mark.parametrize(
    ("subject", "gender", "ages"),
    [
        ("a toddler", None, (4, 12)),
        ("the driver", None, (18, 80)),
        ("an old man", "male", (65, 80)),
        ("grandma", "female", (65, 80)),
        ("a schoolgirl", "female", (4, 17)),
        ("a patient", None, None),
        ("a plumber", None, (18, 80)),
        ("the paramedic", None, None),
        ("a goalkeeper", None, None),
    ],
)
def test_any_human_noun(subject: str, gender: str | None, ages: tuple[float, float] | None) -> None:
    said = read_prompt(f"{subject} is walking")
    assert (said.target, said.action, said.unused) == ("person", "walk", ())
    assert said.body.gender == gender
    if ages is None:
        assert said.body.age_years is None
    else:
        assert said.body.age_years is not None
        assert ages[0] <= said.body.age_years <= ages[1]


def test_nouns_of_people_are_told_from_those_of_animals_and_things() -> None:
    people = ("florist", "barista", "astronaut", "hooligan", "surgeon", "hiker", "widow", "referee")
    others = ("elephant", "kangaroo", "tractor", "toaster", "balloon", "printer", "statue", "market")
    assert [word for word in people if not is_human(word)] == []
    assert [word for word in others if is_human(word)] == []
    with pytest.raises(PromptError, match="target: 'kangaroo' is no person"):
        read_prompt("a kangaroo jumps")


WORDS = (
    "a the his man woman nurse old tall walks jumping raises left arm hand slowly quickly small big steps at 3 m 2.5 "
    "to 4 between and 45 degrees azimuth orientation random range facing away radar towards in office red coat "
    "pauses tired circle back forth times minute every second breathing heart rate , with for 20 years happily because "
    "blue seven km/h 1.8 kg who is hands on hips folded arms room around loop 10 cm high"
)


@quick
@given(st.lists(st.sampled_from(WORDS.split()), min_size=1, max_size=14).map(" ".join))
def test_no_word_is_lost(text: str) -> None:
    try:
        said = read_wanted(text)
    except PromptError:
        return
    kept = {word for phrase in (*said.clauses(), *said.lost) for word in phrase.split()}
    kept |= {word for phrase, _ in said.reader.understood for word in phrase.split()}
    assert set(said.reader.said.split()) <= kept | FILLERS | {","}, (text, said.reader.text)
