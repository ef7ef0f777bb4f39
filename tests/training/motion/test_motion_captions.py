"""Drawn sentences: what they say, and what they must not say."""

from __future__ import annotations

import re

import numpy as np

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, FRAGMENTS
from training.motion.exam_prompts import AMBIGUOUS, PARAPHRASES
from training.motion.motion_captions import caption, negative


def test_captions_have_no_traces_of_the_templates() -> None:
    rng = np.random.default_rng(0)
    for action in CLAUSES:
        for _ in range(40):
            text = caption(rng, (action,), hand="left", speed=0.7)
            assert not re.search(r"[<>{}\[\]?]|  ", text), text


def test_the_hand_is_said_only_where_it_is_known() -> None:
    rng = np.random.default_rng(1)
    said = [caption(rng, ("push",), hand="left") for _ in range(200)]
    assert any("left hand" in s for s in said)
    # "facing left" is an ending; the hand itself isn't named
    assert not any(re.search(r"(left|right) (hand|arm)", caption(rng, ("push",))) for _ in range(200))


def test_a_negative_never_names_the_action_itself() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        assert negative(rng, ("left_arm_raised",)) not in FRAGMENTS["left_arm_raised"]


def test_no_examination_sentence_is_in_the_phrase_book() -> None:
    rng = np.random.default_rng(3)
    drawn = {caption(rng, (a,), hand="right").strip(" .") for a in CLAUSES for _ in range(400)}
    assert not drawn & {p for group in PARAPHRASES.values() for p in group}
    assert all(ruled_out in CLAUSES for _, _, ruled_out in AMBIGUOUS)
