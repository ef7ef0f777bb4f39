"""Prompts about several: each an actor with its own labels, none through another."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

pytest.importorskip("anny")

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.prompts import PromptError
from rfgen_sionna.generative.prompts.actor_clauses import MOST, split_actors
from rfgen_sionna.generative.several_actors import CLEARANCE, actors_from_prompt, read_prompts


@pytest.mark.parametrize(
    ("prompt", "clauses", "relation"),
    [
        ("two people shake hands", ("a person shake hands",) * 2, "facing"),
        ("a woman walks past a man who sits", ("a woman walks", "a man sits"), "past"),
        ("a person and a dog", ("a person stand", "a dog"), "apart"),
        ("a man is waving while a woman walks away", ("a man waving", "a woman walks away"), "apart"),
        ("two men walk side by side", ("a man walk",) * 2, "side by side"),
        ("a boy runs and a girl stands", ("a boy runs", "a girl stands"), "apart"),
        ("Three people stand.", ("a person stand",) * 3, "apart"),
        ("a person claps and another person dances", ("a person claps", "a person dances"), "apart"),
        ("someone pushes a pram", ("someone walks", "a pram rolls"), "pushing"),
        ("a woman walks her dog", ("a woman walks", "a dog walks"), "side by side"),
        ("a dog follows a man", ("a dog walks", "a man walks"), "behind"),
        ("a man who walks is followed by a cat", ("a man walks", "a cat walks"), "in front"),
        ("two women walk towards each other", ("a woman walk",) * 2, "past"),
        ("a tall man and a girl stand at 4 m", ("a tall man stand at 4 m", "a girl stand at 4 m"), "apart"),
        ("a girl runs followed by a dog", ("a girl runs", "a dog runs"), "in front"),
        ("a dog chases a cat", ("a dog runs", "a cat runs"), "behind"),
        ("a man stands behind a dog", ("a man stands", "a dog"), "behind"),
        ("a fan turns behind a person", ("a fan turns", "a person stands"), "behind"),
        ("a car passes a pedestrian", ("a car drives", "a pedestrian stands"), "past"),
        ("a woman approaches a man", ("a woman walks", "a man stands"), "towards"),
        ("a robot vacuum drives past a man", ("a robot vacuum drives", "a man stands"), "past"),
        ("a woman stands behind a man at 3 m", ("a woman stands", "a man stands at 3 m"), "behind"),
        ("a man at 2 m and a man at 4 m, both sitting", ("a man sitting at 2 m", "a man sitting at 4 m"), "apart"),
        ("a man walks with a dog towards the radar", ("a man walks", "a dog walks towards the radar"), "side by side"),
        ("a person sits down; another stands up", ("a person sits down", "a person stands up"), "apart"),
        ("Two people. One walks. The other sits.", ("a person walks", "a person sits"), "apart"),
        ("two people pass each other", ("a person walk",) * 2, "past"),
        ("two people walk away from each other", ("a person walk",) * 2, "parting"),
        ("a man sits and a woman walks behind him", ("a woman walks", "a man sits"), "behind"),
        ("one person falls and another runs towards him", ("a person runs", "a person falls"), "towards"),
        ("a group of three people stands", ("a person stands",) * 3, "apart"),
        ("a family of four walks", ("a person walks",) * 4, "apart"),
        ("in a hall, a man sits and a cat walks", ("a man sits , in a hall", "a cat walks , in a hall"), "apart"),
    ],
)  # fmt: skip
def test_one_clause_an_actor(prompt: str, clauses: tuple[str, ...], relation: str) -> None:
    several = split_actors(prompt)
    assert several is not None
    assert (tuple(" ".join(each.text.split()) for each in several.clauses), several.relation) == (clauses, relation)


@pytest.mark.parametrize(
    "prompt",
    ["a person walks", "a cyclist rides past", "a person rides a bike", "a male person of 40 years", "a dog runs",
     "a 70 year old man walks", "a 1.8 m tall woman walks", "an 80 kg man sits", "a nurse with two bags walks",
     "a woman with a walker walks", "a person raises one arm and then the other", "a robot vacuum drives",
     "a person knocks at the door", "a woman opens a curtain",
     "action: push, distance: 1 m", "a man walks while he waves", "a woman picks up a box and a bag"],
)  # fmt: skip
def test_one_actor_is_not_split(prompt: str) -> None:
    assert split_actors(prompt) is None


@pytest.mark.parametrize(
    ("prompt", "message"),
    [
        ("people walk", "several without a number; write how many"),
        (f"{MOST + 1} people stand", f"at most {MOST} are possible"),
        ("a man kicks a dog", "no interaction of two actors"),
        ("a man and a woman, one sits and the other stands", "leaves open who 'one' is"),
        ("three people: one falls, one stands", "names 3 actors and says what 2 do"),
        ("three people shake hands", "is for two, the prompt names 3"),
    ],
)
def test_crowds_and_contact_are_refused(prompt: str, message: str) -> None:
    with pytest.raises(PromptError, match=message):
        split_actors(prompt)


def test_an_actor_alone_is_not_several() -> None:
    with pytest.raises(PromptError, match=r"names 2 actors; rfgen_sionna\.actors_from_prompt makes them all"):
        Actor.from_prompt("a woman walks past a man who sits")


def test_places_of_the_sentences_agree() -> None:
    with pytest.raises(PromptError, match="surroundings: the prompt names several"):
        read_prompts("a man stands in a living room and a woman stands in an office")


@pytest.mark.parametrize(
    "prompt",
    [
        pytest.param("a woman walks straight past a man who stands", marks=pytest.mark.slow),
        "a man stands and a dog walks",
    ],
)
def test_actors_do_not_touch(prompt: str) -> None:
    actors = actors_from_prompt(prompt, seed=2, duration=2.0, motion="kinematic")
    assert len({actor.name for actor in actors}) == 2
    assert len({actor.action for actor in actors}) == 2
    for t in np.linspace(0.0, 2.0, 9):
        first, second = (actor.vertices(float(t)) for actor in actors)
        assert cKDTree(first).query(second)[0].min() > 0.5 * CLEARANCE


def test_a_walker_passes_the_one_who_stands() -> None:
    walker, stander = actors_from_prompt(
        "a woman walks straight past a man who stands at 4 m", seed=0, duration=2.0, motion="kinematic"
    )
    place = stander.vertices(1.0)[:, :2].mean(axis=0)
    assert np.hypot(*place) == pytest.approx(4.0, abs=0.15)
    way = np.stack([walker.vertices(t)[:, :2].mean(axis=0) - place for t in (0.0, 1.0, 2.0)])
    assert np.sign(way[0, 1]) == -np.sign(way[2, 1])  # across the line of sight
    assert 0.6 < abs(way[1, 0]) < 1.4


@pytest.mark.parametrize(
    ("prompt", "message"),
    [
        ("two people shake hands, facing the radar", "orientation: the actors face each other"),
        ("a man stands at 5 m behind a woman who stands at 3 m", "distance: the prompt names several"),
    ],
)
def test_places_of_actors_agree(prompt: str, message: str) -> None:
    with pytest.raises(PromptError, match=message):
        read_prompts(prompt)


@pytest.mark.parametrize(
    ("prompt", "way"),
    [
        ("a man pushes a pram towards the radar", -1.0),
        ("a man walks with his dog away from the radar", 1.0),
        pytest.param("a man walks behind a woman towards the radar", -1.0, marks=pytest.mark.slow),
        pytest.param("a woman walks towards the radar past a man who stands", -1.0, marks=pytest.mark.slow),
    ],
)
def test_a_direction_is_that_of_all_who_go_together(prompt: str, way: float) -> None:
    actors = actors_from_prompt(prompt, seed=0, duration=1.0, motion="kinematic")
    for actor in actors if "past" not in prompt else actors[:1]:
        moved = (actor.vertices(1.0) - actor.vertices(0.0)).mean(axis=0)
        assert way * moved[0] > 3.0 * abs(moved[1])


def test_each_is_as_far_as_the_prompt_says_and_faces_the_radar() -> None:
    for actor in actors_from_prompt("three people stand at 2 m", seed=0, duration=0.1, motion="kinematic"):
        x, y = actor.vertices(0.0)[:, :2].mean(axis=0)
        assert np.hypot(x, y) == pytest.approx(2.0, abs=0.12)
        assert np.cos(actor.orientation[0] - np.arctan2(-y, -x)) > 0.99
        assert "0° from facing the radar" in actor.report()


@pytest.mark.parametrize("prompt", ["a girl runs followed by a woman", "two people run towards each other"])
def test_those_who_run_to_each_other_keep_on_a_line(prompt: str) -> None:
    assert [each.manner.path for each in read_prompts(prompt).said] == ["straight"] * 2


def test_two_walk_away_from_each_other() -> None:
    actors = actors_from_prompt("two people walk away from each other", seed=0, duration=1.0, motion="kinematic")
    apart = [
        np.linalg.norm(np.subtract(*(actor.vertices(t)[:, :2].mean(axis=0) for actor in actors))) for t in (0.0, 1.0)
    ]
    assert apart[0] < 2.0
    assert apart[1] > apart[0] + 1.0


def test_two_who_shake_hands_are_at_the_azimuth() -> None:
    actors = actors_from_prompt(
        "two people shake hands at azimuth 20 degrees", seed=0, duration=0.1, motion="kinematic"
    )
    middle = np.mean([actor.vertices(0.0)[:, :2].mean(axis=0) for actor in actors], axis=0)
    assert np.degrees(np.arctan2(middle[1], middle[0])) == pytest.approx(20.0, abs=2.0)


def test_a_dog_keeps_pace_with_its_person() -> None:
    person, dog = actors_from_prompt("a woman walks with her dog", seed=1, duration=2.0, motion="kinematic")
    speeds = [np.linalg.norm((a.vertices(2.0) - a.vertices(0.0)).mean(axis=0)) / 2.0 for a in (person, dog)]
    assert speeds[1] == pytest.approx(speeds[0], rel=0.15)
    assert (person.action, dog.action) == ("walk_straight", "walk")


def test_seeds_are_of_each_actor() -> None:
    first, second = actors_from_prompt("two people stand", seed=5, duration=1.0, motion="kinematic")
    again = actors_from_prompt("two people stand", seed=5, duration=1.0, motion="kinematic")[1]
    np.testing.assert_array_equal(second.vertices(0.5), again.vertices(0.5))
    assert first.vertices(0.0)[:, 2].max() != pytest.approx(second.vertices(0.0)[:, 2].max(), abs=1e-3)
    assert "its place among the actors" in second.report()
