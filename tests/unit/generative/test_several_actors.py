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


@pytest.mark.parametrize("prompt", ["a woman walks straight past a man who stands", "a man stands and a dog walks"])
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
