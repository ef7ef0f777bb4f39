"""Sentences: what the phrase book says, and what it must not say."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, FRAGMENTS, OPEN_CLAUSES, inflect
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder, pieces, stem, tokenise, words
from rfgen_sionna.generative.diffusion.understanding import understand
from rfgen_sionna.generative.motion import ACTIONS
from training.motion.motion_captions import vocabulary


@pytest.mark.parametrize(
    ("clause", "form", "said"),
    [
        ("<raise> the left arm", "s", "raises the left arm"),
        ("<raise> the left arm", "ing", "raising the left arm"),
        ("<do> a star jump and <go>", "s", "does a star jump and goes"),
        ("<swipe> left", "ing", "swiping left"),
        ("<swing> a finger", "ing", "swinging a finger"),
        ("<hop>", "ing", "hopping"),
        ("<push> away", "s", "pushes away"),
        ("<wander> about", "ing", "wandering about"),
    ],
)
def test_verbs_take_their_form(clause: str, form: str, said: str) -> None:
    assert inflect(clause, form) == said


def test_the_phrase_book_covers_actions_of_the_synthesiser_in_many_wordings() -> None:
    assert set(CLAUSES) <= set(ACTIONS)
    assert min(len(c) for c in CLAUSES.values()) >= 12
    assert set(FRAGMENTS) == set(CLAUSES)
    assert all(set(named) <= set(CLAUSES) for named in OPEN_CLAUSES)


def test_spellings_of_counter_clockwise_are_one_word() -> None:
    for text in ("Counter-clockwise", "anti clockwise", "anticlockwise", "counterclockwise"):
        assert words(text) == ["counterclockwise"]


def test_forms_of_a_word_share_pieces() -> None:
    assert stem("swiping") == stem("swipes") == stem("swipe")
    assert len(set(pieces("raising")) & set(pieces("raises"))) >= 3
    assert not set(pieces("left")) & set(pieces("right"))


def test_an_empty_sentence_is_read_without_fault() -> None:
    reading = TextEncoder(("walk",)).eval()(tokenise(["", "a person"]))
    assert np.isfinite(reading.pooled.detach().numpy()).all()


def test_a_prompt_of_unknown_words_is_warned_about_and_one_without_words_refused() -> None:
    encoder = TextEncoder(tuple(CLAUSES)).eval()
    known = vocabulary()
    strange = understand(encoder, "a man paddles a canoe", known)
    assert not strange.known
    assert strange.unknown == ("paddles", "canoe")
    assert strange.action in strange.warnings[0]
    with pytest.raises(ValueError, match="no words"):
        understand(encoder, " ... ", known)
