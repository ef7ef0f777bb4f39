"""Sentences and keywords are read as what they say, and what they don't say is left open or refused."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.prompts import PromptError, parse_environment, read_prompt
from rfgen_sionna.generative.prompts.body_prompt import AGES, HEIGHTS
from rfgen_sionna.generative.prompts.environment_prompt import PLACE_PATTERNS
from rfgen_sionna.generative.prompts.vocabulary import SCENE_PATTERNS
from rfgen_sionna.scene import available_scenes
from rfgen_sionna.scene.furnished import PLACES

PARAPHRASES = {
    "walk_to_and_fro": [
        "a person walks backwards and forwards",
        "a pedestrian paces to and fro",
        "a person walks towards and away from the radar",
        "somebody moves towards the radar and back again",
        "a man walks away from the radar and then comes back",
    ],
    "walk": ["Someone strolls around in front of the radar", "person, walk"],
    "walk_straight": [
        "a person walking towards the radar",
        "a man slowly walking away",
        "somebody approaches the radar",
        "a girl comes closer",
        "a person moving away from the camera",
        "a person walks straight ahead",
        "a person walks to the left",
    ],
    "jump": ["A man jumps up and down", "jump", "PERSON JUMPING!!!"],
    "jumping_jacks": ["a person doing jumping jacks, facing forward", "a boy does star jumps", "jumpingjacks"],
    "pick_up": [
        "An old man bends down and picks up his keys from the ground",
        "a person bends over to grab a bottle off the floor",
        "the janitor is picking up an item, facing forward",
    ],
    "t_pose": ["a person in a T pose", "person, T-pose, facing away"],
    "y_pose": ["a person does a Y-pose", "Y pose"],
    "both_arms_raised": ["Person raises both arms", "a person raises the left arm and the right arm"],
    "left_arm_raised": ["left arm raised, person", "a nurse raises her left hand"],
    "right_arm_raised": ["a person lifts her right arm", "a raised right hand, person"],
    "left_arm_horizontal": ["a person standing with only the left hand raised horizontally"],
    "left_leg_raised": ["a man lifts up his left knee", "someone stands on the right leg"],
    "swipe_left": ["someone swipes their hand to the left", "left swipe"],
    "swipe_right": ["Somebody is swiping right with the left hand"],
    "push": ["a person pushes the left hand forward towards the radar", "push"],
    "pull": ["a person pulls", "a woman pulled her hand in"],
    "circle_clockwise": ["a person draws a circle clockwise with the right hand", "clockwise circle"],
    "circle_counterclockwise": ["anticlockwise circle, person", "a person traces a circle anti-clockwise"],
    "click": ["a person clicks with the right index finger", "a person taps in the air"],
    "finger_swing": ["Person wags the index finger back and forth", "finger swing"],
    "standing": ["human standing motionless", "A person is idle", "the driver stands still"],
    "fall": ["grandpa falls down", "a patient is falling over, at 2 to 3 m"],
    "sit_down": ["an elderly lady sits down"],
    "wave": ["the teacher waves", "somebody is waving"],
    "crawl": ["a toddler is crawling on all fours"],
}
"""Action -> sentences of the grammar's readers of persons, ways and sides; the action reader has its own."""


@pytest.mark.parametrize(("action", "prompt"), [(a, p) for a, prompts in PARAPHRASES.items() for p in prompts])
def test_paraphrases_are_read_as_their_action_and_leave_nothing_over(action: str, prompt: str) -> None:
    scene = read_prompt(prompt)
    assert scene.choices == (action,)
    assert scene.unused == ()


@pytest.mark.parametrize(
    ("phrase", "angle"),
    [
        ("facing forward", 0),
        ("facing the radar", 0),
        ("looking towards the sensor", 0),
        ("head-on", 0),
        ("towards the radar", 0),
        ("facing left", 90),
        ("turned to the left", 90),
        ("side on", 90),
        ("facing sideways", 90),
        ("facing right", 270),
        ("with his back to the radar", 180),
        ("facing away", 180),
        ("seen from behind", 180),
        ("45 degrees", 45),
        ("turned 30° to the right", 330),
        ("at an angle of thirty degrees to the left", 30),
        ("rotated by -45 degrees", 315),
        ("facing 90 degrees to the right", 270),
        ("orientation: 90", 90),
        ("orientation: 30 degrees to the right", 330),
        ("orientation = left", 90),
        ("orientation: away", 180),
    ],
)
def test_orientation(phrase: str, angle: float) -> None:
    scene = read_prompt(f"a person jumping, {phrase}")
    assert scene.orientation_deg == angle
    assert scene.unused == ()


@pytest.mark.parametrize(
    ("phrase", "metres"),
    [
        ("at 3 m", 3.0),
        ("at 2.5m", 2.5),
        ("at 2,5 m", 2.5),
        ("two metres away", 2.0),
        ("two and a half meters from the radar", 2.5),
        ("half a metre in front of the radar", 0.5),
        ("at a distance of 350 cm from the radar", 3.5),
        ("10 feet away", 3.048),
        ("at about twenty five metres", 25.0),
        ("at 190 cm", 1.9),
        ("at 1e1 m", 10.0),
    ],
)
def test_distance(phrase: str, metres: float) -> None:
    scene = read_prompt(f"a person jumping {phrase}")
    assert scene.distance_m == pytest.approx(metres)
    assert scene.unused == ()


def test_lengths_that_are_no_distances_are_not_read_as_one() -> None:
    assert read_prompt("a person 1.8 m tall jumping").distance_m is None
    scene = read_prompt("a person walks 3 m")
    assert scene.distance_m is None
    assert scene.unused == ("3 m",)


def test_numbers_of_the_body_are_taken_as_they_are() -> None:
    body = read_prompt("an adult male, 35 years old, 1.82 m tall, weighing 82 kg, stands still").body
    assert (body.gender, body.age_years, body.height_m, body.weight_kg) == ("male", 35, 1.82, 82)
    for phrase in ("standing still, 190cm, 100 kilos", "standing still, 100 kilos, 190 cm", "190 cm, 100 kg, standing"):
        scene = read_prompt(f"a person {phrase}")
        assert (scene.distance_m, scene.body.height_m, scene.body.weight_kg) == (None, 1.9, 100)
    assert read_prompt("a 1.9 m man walks").body.height_m == 1.9
    assert read_prompt("a 5 ft 10 in tall man walks").body.height_m == pytest.approx(1.778)
    assert read_prompt("a 30-year-old woman weighing 150 lbs pulls").body.weight_kg == pytest.approx(68.04, abs=0.01)


@pytest.mark.parametrize("seed", range(6))
def test_words_about_the_body_draw_from_their_class(seed: int) -> None:
    body = read_prompt("a tall, strong and heavy young woman strolls", seed=seed).body
    assert body.gender == "female"
    assert AGES["young adult"][0] <= body.age_years <= AGES["young adult"][1]
    low, high = HEIGHTS["female"]["tall"]
    assert low <= body.height_m <= high
    assert 29 <= body.weight_kg / body.height_m**2 <= 34.1
    assert body.muscle >= 0.75


def test_an_unmentioned_body_is_left_open() -> None:
    body = read_prompt("a person jumping").body
    assert (body.gender, body.age_years, body.height_m, body.weight_kg, body.muscle) == (None,) * 5


def test_one_word_more_does_not_change_the_other_draws() -> None:
    one = read_prompt("an elderly person walking", seed=5).body
    two = read_prompt("a muscular elderly person walking", seed=5).body
    assert one.age_years == two.age_years


def test_short_steps_are_not_a_short_person() -> None:
    scene = read_prompt("a person takes short steps while walking")
    assert scene.body.height_m is None
    assert scene.manner.amplitude == 0.6


def test_hands_belong_to_gestures() -> None:
    assert read_prompt("someone swiping right with the left hand").hand == "left"
    assert read_prompt("someone sweeps their right hand to the left").hand == "right"
    assert read_prompt("left hand swiping right, person").action == "swipe_right"


def test_speed_and_surroundings() -> None:
    scene = read_prompt("A teenager walks towards the radar very quickly in Munich")
    assert (scene.speed, scene.surroundings, scene.orientation_deg) == (1.6, "munich", 0)
    assert read_prompt("kid walking in the living room, side on").surroundings == "living_room"
    assert read_prompt("a person doing slow jumps").speed == 0.7


def test_what_is_left_open_is_drawn_from_the_seed_and_said() -> None:
    drawn = {read_prompt("a person raises an arm", seed=seed).action for seed in range(20)}
    assert drawn == {"left_arm_raised", "right_arm_raised"}
    scene = read_prompt("a person raises the left or right arm", seed=3)
    assert scene.choices == ("left_arm_raised", "right_arm_raised")
    assert scene == read_prompt("a person raises the left or right arm", seed=3)
    assert "drawn from left_arm_raised or right_arm_raised (seed 3)" in scene.report()
    assert set(read_prompt("a person walking or jumping").choices) == {"walk", "jump"}


@pytest.mark.parametrize(
    ("prompt", "negative", "choices"),
    [
        ("a person raising an arm", "left arm", ("right_arm_raised",)),
        ("a person raising an arm", "right", ("left_arm_raised",)),
        ("a person swipes", "to the left", ("swipe_right",)),
        ("a person draws a circle", "clockwise", ("circle_counterclockwise",)),
        ("a person draws a circle", "counter-clockwise", ("circle_clockwise",)),
        ("a person walking or jumping", "jumping", ("walk",)),
        ("a person jumping or doing jumping jacks", "jumping", ("jumping_jacks",)),
    ],
)
def test_the_negative_prompt_takes_choices_away(prompt: str, negative: str, choices: tuple[str, ...]) -> None:
    for seed in range(5):
        assert read_prompt(prompt, negative, seed=seed).choices == choices


def test_the_negative_prompt_narrows_body_orientation_and_hand() -> None:
    for seed in range(10):
        scene = read_prompt("an adult clicks", "women, elderly, facing forward, sideways, left hand", seed=seed)
        assert scene.body.gender == "male"
        assert 18 <= scene.body.age_years <= 64
        assert scene.orientation_deg in (180.0, 270.0)
        assert scene.hand == "right"


@pytest.mark.parametrize(
    ("prompt", "negative", "field"),
    [
        ("a person walking", "walk", "action"),
        ("a person raising the left arm", "left arm", "action"),
        ("a person walking facing the radar", "facing forward", "orientation"),
        ("a person walks slowly", "slow", "speed"),
        ("a tall person walking", "tall", "height"),
        ("a 70 year old walking, person", "elderly", "age"),
        ("a boy walking", "men", "gender"),
        ("a person walking in a living room", "living room", "surroundings"),
        ("a person clicks with the left hand", "left hand", "hand"),
        ("a person walking", "a person", "person"),
        ("a person walking facing left, facing right", "", "orientation"),
        ("a person jumping at 3 m, 4 m away", "", "distance"),
        ("a 10 year old man walking", "", "age"),
        ("a man walking, female", "", "gender"),
    ],
)
def test_contradictions_are_refused_by_name(prompt: str, negative: str, field: str) -> None:
    with pytest.raises(PromptError, match=field):
        read_prompt(prompt, negative)


@pytest.mark.parametrize(
    ("prompt", "message"),
    [
        ("", "action: '' names none; say what the person does"),
        ("a person", "action: .* names none; say what the person does"),
        ("a person at 3 m", "action: .* names none"),
        (
            "a person rides a unicycle",
            "cannot be done: .*; the nearest that can be done are: a person .*; a person",
        ),
        ("purple monkey dishwasher", "action: .*the nearest that can be done"),
        ("an elephant runs", "target: 'elephant' is no person, animal or thing"),
        ("two people walking", "target: the prompt names 2 actors"),
        ("women walking", "target: 'women' are several without a number"),
        ("a person walking and jumping", r"names several actions \('walk' and 'jump'\)"),
        ("a person turns 45 degrees", "action: 'turns 45 degrees'"),
        ("a person raises the left arm by 45 degrees", "angle: 'arm by 45 degrees' is the angle of a limb"),
        ("a person walking without arms", "unwanted choices go into the negative prompt"),
        *(
            (f"a person jumping {word} facing away", f"'{word.split()[-1] if word == 'but not' else word}.* negates")
            for word in ("excluding", "except", "avoids", "avoiding", "rather than", "but not", "minus")
        ),
        ("a person jumping instead of facing away", "'instead' negates"),
        ("a person stops walking", "'stops' negates"),
        ("a person used to walk", "'used to' negates"),
        ("a person picks up a box without bending", "'without' negates"),
        (
            "a person jumping, orientation: 400",
            r"orientation: .*400°; allowed are -180° to 360°",
        ),
        ("a person jumping, turned -200 degrees", "orientation: .*-200°"),
        ("a person jumping behind the radar", "azimuth: 'behind the radar'"),
        ("a person jumping 2 m behind the radar", "azimuth: '2 m behind the radar'"),
        ("a person jumping at 2 m and 3 m", "distance: .*several: '2 m and 3 m'"),
        ("a person jumping at 2 or 3 m", "distance: .*several"),
        ("a person walks at 20 to 30 m/s", "speed: .* is 20 m/s; allowed are 0.05 m/s to 12 m/s"),
        ("a person jumping 2 m 50 cm away", "distance: .*several"),
        ("a person jumping at 1e30 m", "distance: .*no number of metres"),
        ("a person jumping at 2x m", "distance: .*no number of metres"),
        ("a person standing, 1.9 m, 100 kg", 'distance: .*write "1.9 m tall" or "1.9 m away"'),
        ("a person isn't walking", "unwanted choices go into the negative prompt"),
        ("a person jumping, 0 m away", "distance: .* is 0 m; allowed are 0.05 m"),
        ("a man, 300 kg, jumping", "12 kg to 200 kg"),
        ("a man 3 m tall jumping", r"0\.9 m to 2\.2 m"),
        ("a fat child jumping", "give a number"),
    ],
)
def test_what_cannot_be_carried_out_is_refused_with_what_is_known(prompt: str, message: str) -> None:
    with pytest.raises(PromptError, match=message):
        read_prompt(prompt)


def test_what_is_not_understood_is_said() -> None:
    scene = read_prompt("a cheerful person jumping for 3 seconds in a red coat", "purple sky")
    assert {"cheerful", "for 3 seconds", "in a red coat", "purple sky"} <= set(scene.unused)
    assert all(phrase in scene.report() for phrase in scene.unused)
    assert "prompt: 'cheerful' was not understood and has no effect" in scene.warnings


@pytest.mark.parametrize(
    "words", ["in a repetitive manner", "repeatedly", "again and again", "with a periodic motion", "several times"]
)
def test_repetition_is_understood_where_there_is_any(words: str) -> None:
    for prompt in (f"a person jumping {words}", f"swipe left {words}"):
        said = read_prompt(prompt)
        assert not said.unused
        assert (words, "repeated, as this action is") in said.understood
    assert read_prompt(f"a person in a T pose {words}").unused == (words,)


@pytest.mark.parametrize("arguments", [(None,), (3,), ("a person walking", None)])
def test_only_texts_are_prompts(arguments: tuple) -> None:
    with pytest.raises(TypeError, match="expected a text"):
        read_prompt(*arguments)


SENTENCES: list[tuple[str, dict[str, Any]]] = [
    ("a person walks towards the radar", {"action": "walk_straight", "orientation_deg": 0}),
    ("a man is walking slowly away from the radar", {"action": "walk_straight", "orientation_deg": 180, "speed": 0.7}),
    ("She approaches the sensor quickly", {"action": "walk_straight", "orientation_deg": 0, "speed": 1.3}),
    ("a kid comes closer to the radar", {"action": "walk_straight", "orientation_deg": 0}),
    ("she walks at a brisk pace towards the radar", {"action": "walk_straight", "orientation_deg": 0, "speed": 1.3}),
    ("a person walks back to the radar", {"action": "walk_straight", "orientation_deg": 0}),
    ("a man walks to his right", {"action": "walk_straight", "orientation_deg": 270}),
    ("a person walks straight towards the radar", {"action": "walk_straight", "orientation_deg": 0}),
    ("a person walks back and forth", {"action": "walk_to_and_fro", "orientation_deg": None}),
    ("a person walking back and forth towards the radar", {"action": "walk_to_and_fro", "orientation_deg": 0}),
    ("a person walks towards the radar and back", {"action": "walk_to_and_fro", "orientation_deg": None}),
    ("somebody walks away from the radar and comes back again", {"action": "walk_to_and_fro", "orientation_deg": None}),
    ("a person walks backwards away from the radar", {"action": "walk_backwards", "orientation_deg": 0}),
    ("a man falls towards the radar", {"orientation_deg": 0}),
    ("a person paces slowly up and down", {"action": "walk_to_and_fro", "speed": 0.7}),
    ("a person walks with her back to the radar", {"action": "walk", "orientation_deg": 180}),
    ("a person walking, facing away from the radar", {"action": "walk", "orientation_deg": 180}),
    ("a man jumping at azimuth 20 degrees", {"bearing_deg": 20, "orientation_deg": None}),
    ("a man standing at an azimuth of -30°, 2 m away", {"bearing_deg": -30, "distance_m": 2}),
    ("a woman pushes, 20 degrees to the left of the radar's boresight", {"bearing_deg": 20, "orientation_deg": None}),
    ("a woman pulls 15 degrees right of boresight", {"bearing_deg": -15}),
    ("a man standing at a bearing of ten degrees to the right", {"bearing_deg": -10}),
    ("a man 10 degrees off the boresight, standing, facing left", {"bearing_deg": 10, "orientation_deg": 90}),
    ("somebody jumps 25° azimuth, turned 45 degrees to the right", {"bearing_deg": 25, "orientation_deg": 315}),
    ("a person stands 45 degrees to the left", {"bearing_deg": None, "orientation_deg": 45}),
    ("a person raises the left and the right arm", {"action": "both_arms_raised"}),
    ("a person raises an arm, the right arm", {"action": "right_arm_raised"}),
    ("a person raises the left arm or the right arm", {"choices": ("left_arm_raised", "right_arm_raised")}),
    ("a person swipes to the left or to the right", {"choices": ("swipe_left", "swipe_right")}),
    ("a person quickly swipes to the right", {"action": "swipe_right", "speed": 1.3}),
    ("a person swipes quickly to the left with the left hand", {"action": "swipe_left", "hand": "left", "speed": 1.3}),
    ("action: push", {"action": "push"}),
    ("action: jump, negative: facing away", {"orientation_deg": None, "negative": "facing away"}),
    ("a person jumping, negative: facing forward, sideways; distance: 2 m",
     {"orientation_deg": 180, "distance_m": 2, "negative": "facing forward, sideways"}),
    ('{"action": "raises an arm", "negative_prompt": "left arm", "target": "man"}', {"action": "right_arm_raised"}),
    ("a person jumping at 3 m and 1.8 m tall", {"distance_m": 3}),
    ("Action: jumping jacks; target: woman; orientation: 90; distance: 2 m; environment: living room",
     {"action": "jumping_jacks", "orientation_deg": 90, "distance_m": 2, "surroundings": "living_room"}),
    ("action=push, hand=left, distance=2, azimuth=-10",
     {"action": "push", "hand": "left", "distance_m": 2, "bearing_deg": -10}),
    ('{"action": "click", "target": "a tall man", "environment": "free space"}',
     {"action": "click", "surroundings": "free space"}),
    ("target: man, age: 30, height: 1.8 m, weight: 80 kg, action: standing, orientation: facing left",
     {"action": "standing", "orientation_deg": 90}),
    ("orientation: 45 distance: 2.5 m action: push, person", {"orientation_deg": 45, "distance_m": 2.5}),
    ("scene: Munich, person, walk", {"surroundings": "munich", "action": "walk"}),
    ("a person standing in free space", {"surroundings": "free space"}),
    ("a person walks along a street", {"surroundings": "simple_street_canyon", "action": "walk"}),
    ("two metres in front of the radar a man does star jumps", {"action": "jumping_jacks", "distance_m": 2}),
    ("an elderly woman at three and a half metres picks something up", {"action": "pick_up", "distance_m": 3.5}),
    ("Raise your right hand", {"action": "right_arm_raised"}),
    ("T-pose, woman, at 2 m, facing the radar", {"action": "t_pose", "distance_m": 2, "orientation_deg": 0}),
    ("in a living room a teenager jumps on the spot, seen from the side",
     {"action": "jump", "surroundings": "living_room", "orientation_deg": 90}),
]  # fmt: skip


@pytest.mark.parametrize(("prompt", "fields"), SENTENCES, ids=[prompt for prompt, _ in SENTENCES])
def test_natural_sentences_and_keywords(prompt: str, fields: dict[str, Any]) -> None:
    scene = read_prompt(prompt)
    assert {name: getattr(scene, name) for name in fields} == fields
    assert scene.unused == ()


def test_keywords_describe_the_body() -> None:
    body = read_prompt("target: woman, age: 30, height: 1.7 m, weight: 60 kg, action: push").body
    assert (body.gender, body.age_years, body.height_m, body.weight_kg) == ("female", 30, 1.7, 60)


@pytest.mark.parametrize(
    ("prompt", "message"),
    [
        ("a person raises the left arm, then the right arm", "action: .*several"),
        ("a person swipes left and right", "action: .*several"),
        ("a person draws a circle clockwise and then counter-clockwise", "action: .*several"),
        ("a person walks towards the radar, facing away", "orientation: .*several"),
        ("a person standing at azimuth 120 degrees", "azimuth: .*-90° to 90°"),
        ("a person standing at azimuth 20 degrees, 10 degrees left of boresight", "azimuth: .*several"),
        ("a person walking in a living room or street", "surroundings: .*several: 'in a living room', 'or street'"),
        ("a person walking in Munich or Florence", "surroundings: .*several"),
        ("a person walking in a kitchen", r"surroundings: 'in a kitchen' names none that is known; .*living_room"),
        ("a person walking in a small modern kitchen", "surroundings: 'in a small modern kitchen'"),
        ("a person walking in a moonbase", r"surroundings: 'in a moonbase' names none that is known; .*living_room"),
        ("a person walking in the small moonbase at 3 m", "surroundings: 'in the small moonbase'"),
        ("a person jumping outdoors", "surroundings: 'outdoors'.*free space"),
        ("a person walks across a kitchen", "surroundings: 'across a kitchen'"),
        ("action: push, environment: moon base", "environment: 'moon base' names no scene"),
        ("action: push, environment: not a living room", "negates something"),
    ],
)
def test_what_would_be_misread_is_refused(prompt: str, message: str) -> None:
    with pytest.raises(PromptError, match=message):
        read_prompt(prompt)


@pytest.mark.parametrize(
    "phrase",
    [
        "in a repetitive manner",
        "in place",
        "in the air",
        "in front of the radar",
        "in a hurry",
        "in a red coat",
        "in the middle",
        "in an energetic way",
        "in a T pose",
    ],
)
def test_what_is_said_like_a_place_but_is_none_is_not_refused(phrase: str) -> None:
    assert read_prompt(f"a person who {'stands' if 'pose' in phrase else 'jumps'} {phrase}").surroundings is None


@pytest.mark.parametrize("negative", ["not facing away", "without facing away", "minus facing away"])
def test_a_negative_prompt_that_negates_is_refused(negative: str) -> None:
    with pytest.raises(PromptError, match=r"negative prompt: .* negates what is forbidden already"):
        read_prompt("a person jumping", negative)


@pytest.mark.parametrize("prompt", ["a person pushes both hands forward", "a person clicks with both hands"])
def test_gestures_are_made_with_both_hands_where_that_is_said(prompt: str) -> None:
    scene = read_prompt(prompt)
    assert scene.hand == "both"
    assert scene.unused == ()
    with pytest.raises(PromptError, match="forbids"):
        read_prompt(prompt, "with both hands")


def test_a_swipe_takes_one_hand() -> None:
    scene = read_prompt("a person swipes to the left with both hands")
    assert scene.hand in ("left", "right")
    assert scene.unused == ("with both hands",)


@pytest.mark.parametrize("negative", ["walking", "a person who walks"])
def test_a_negative_prompt_without_a_way_forbids_every_walk(negative: str) -> None:
    with pytest.raises(PromptError, match="forbids"):
        read_prompt("a person walks towards the radar", negative)
    assert read_prompt("a person walks away from the radar", "walking back and forth").action == "walk_straight"


def test_the_report_says_what_was_decided_and_by_whom() -> None:
    scene = read_prompt("a tall woman pulls, facing left", seed=1)
    report = scene.report()
    for name, value, origin in (
        ("target", "a person", "from the prompt"),
        ("action", "pull: pulls a hand back", "from the prompt"),
        ("hand", scene.hand, r"drawn from seed 1"),
        ("orientation", "90°, turned left", "from the prompt"),
        ("distance", "3 m", "default"),
        ("azimuth", "0°, straight ahead", "default"),
        ("speed", "× 1", "default"),
        ("surroundings", "free space", "default"),
        ("gender", "female", "from the prompt"),
        ("age", f"{scene.body.age_years:g} years", r"drawn from young adult or middle-aged or elderly \(seed 1\)"),
        ("height", f"{scene.body.height_m:g} m", r"drawn from tall \(seed 1\)"),
        ("weight", "open", "drawn from seed 1"),
        ("muscle", "open", "drawn from seed 1"),
    ):
        assert re.search(rf"^  {name} +{value} +{origin}$", report, re.MULTILINE), (name, report)
    assert re.search("^  hand +right +from the prompt$", read_prompt("right hand click").report(), re.MULTILINE)
    assert re.search(
        "^  hand +right +from the negative prompt$", read_prompt("click", "left hand").report(), re.MULTILINE
    )


def test_the_hand_that_the_report_names_is_the_one_that_moves() -> None:
    hands = {}
    for seed in range(10):
        hands[seed] = read_prompt("a person pulls", seed=seed).hand
        drawn, named = (KinematicSource(30.0)("pull", 0.5, seed, hand=hand) for hand in (None, hands[seed]))
        np.testing.assert_array_equal(drawn.rotations, named.rotations)
    assert set(hands.values()) == {"left", "right"}


@pytest.mark.parametrize("seed", [-1, None, 0.5, True, "0"])
def test_seeds_that_are_none(seed: Any) -> None:
    with pytest.raises(ValueError, match=rf"seed is {seed!r}: a whole number of at least 0"):
        read_prompt("a person walking", seed=seed)


WORDS = """
    a the his left right arm hand leg and or then not in at to of , . : 3 m 45 degrees radar person man walks raises
    swipes pushes circle clockwise towards away from back forth azimuth orientation distance environment living room
    street box kitchen tall 1.8 80 kg years old slowly facing boresight 99999999999999 minus half 5ft 6 \u0663 ² (?P<a>
    ~ m/s ° environment:
"""


@settings(deadline=None, max_examples=40)
@given(
    st.one_of(st.text(max_size=80), st.lists(st.sampled_from([*WORDS.split(), "9" * 400]), max_size=14).map(" ".join)),
    st.lists(st.sampled_from(WORDS.split()), max_size=4),
)
def test_any_text_is_read_or_refused_but_never_crashes(text: str, negative: list[str]) -> None:
    try:
        scene = read_prompt("a person walking, " + text, " ".join(negative))
    except PromptError:
        return
    assert scene.action in scene.choices
    assert scene.action in scene.report()
    for value in (scene.orientation_deg, scene.distance_m, scene.bearing_deg):
        assert value is None or np.isfinite(value)


@pytest.mark.parametrize(
    ("text", "scene"),
    [
        ("a living room", "living_room"),
        ("in the lounge", "living_room"),
        ("Living-room", "living_room"),
        ("a street with parked cars", "simple_street_canyon_with_cars"),
        ("a street canyon", "simple_street_canyon"),
        ("downtown Munich", "munich"),
        ("München", "munich"),
        ("box with two screens", "box_two_screens"),
        *((name, name) for name in SCENE_PATTERNS),
    ],
)
def test_surroundings(text: str, scene: str) -> None:
    assert parse_environment(text).scene == scene


@pytest.mark.parametrize(
    "text", [None, "", "  ", "free space", "in free space", "an anechoic chamber", "no surroundings"]
)
def test_no_surroundings(text: str | None) -> None:
    assert parse_environment(text) is None


def test_unknown_surroundings_are_refused_and_unknown_furniture_is_said() -> None:
    with pytest.raises(PromptError, match=r"'a kitchen' names no scene that is known.*living_room"):
        parse_environment("a kitchen")
    for several in ("Munich or Florence", "a living room or a street", "free space or a living room"):
        with pytest.raises(PromptError, match="several scenes"):
            parse_environment(several)
    for negated in ("not a living room", "anything except a street", "a street without cars", "no living room"):
        with pytest.raises(PromptError, match=r"negates something .* known: free space"):
            parse_environment(negated)
    with pytest.raises(TypeError, match="environment"):
        parse_environment(3)
    cosy = parse_environment("a cosy living room with a piano")
    assert cosy.unused == ("cosy", "piano")
    assert "piano" in cosy.warnings()[1]


def test_prompts_can_name_every_scene_there_is() -> None:
    assert set(SCENE_PATTERNS) == set(available_scenes())
    named = {parse_environment(name).place for name in (*SCENE_PATTERNS, *PLACE_PATTERNS)} - {None}
    assert named == set(PLACES)


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("in an office", "office"),
        ("in a laboratory", "lab"),
        ("in the hallway", "corridor"),
        ("in a classroom", "classroom"),
        ("in a garage", "garage"),
        ("on a playground", "playground"),
        ("in an open field", "open field"),
        ("in a bedroom", "bedroom"),
        ("in a living room", "living room"),
        ("in a street", "street"),
    ],
)
def test_prompts_can_name_every_furnished_place(words: str, place: str) -> None:
    read = read_prompt(f"a person jumping {words}")
    assert read.surroundings is not None
    assert parse_environment(read.surroundings).place == place
    assert parse_environment(words).place == place


def test_reading_a_prompt_needs_no_torch() -> None:
    code = (
        "import sys; from rfgen_sionna.generative.prompts import read_prompt; read_prompt('a person walking');"
        "assert not {'torch', 'anny', 'mitsuba', 'drjit'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_hands_that_are_forbidden_are_not_taken() -> None:
    for prompt, negative in [
        ("a person pushes", "left hand, right hand"),
        ("a person pushes with both hands", "left hand"),
    ]:
        with pytest.raises(PromptError, match=r"hand: the negative prompt forbids 'left hand'"):
            read_prompt(prompt, negative)
    assert read_prompt("a person pushes", "both hands").hand in ("left", "right")
    assert read_prompt("action: push, hand: both").hand == "both"
