"""Sentences for actions, drawn from the phrase book."""

from __future__ import annotations

import re

import numpy as np

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.wording import ENDINGS, FRAGMENTS, JOINERS, OPEN_CLAUSES, PACES, SUBJECTS

SLOW, FAST = 0.87, 1.15
"""Speeds beyond which a sentence may say that it is slow or fast."""
_THIRD = {"do": "does", "go": "goes", "have": "has"}
_STAY = {"just"}


def caption(
    rng: np.random.Generator, actions: tuple[str, ...], *, hand: str = "", speed: float = 1.0, doubt: float = 0.12
) -> str:
    """A sentence about a motion.

    Args:
        rng: where its wording comes from.
        actions: one action, or what the legs and what the arms do.
        hand: working hand of a one-handed action, or empty.
        speed: factor on the usual speed; said now and then where it is far from 1.
        doubt: share of sentences that leave the action open, where there are any.
    """
    options = [c for named, clauses in OPEN_CLAUSES.items() if actions[0] in named for c in clauses]
    if len(actions) == 1 and options and rng.uniform() < doubt:
        clause = _pick(rng, tuple(options))
    elif len(actions) == 1 and rng.uniform() < 0.06:
        return _pick(rng, FRAGMENTS[actions[0]]) + _pick(rng, ENDINGS)
    else:
        clause = _pick(rng, CLAUSES[actions[0]])
    text = _sentence(rng, _filled(rng, clause, hand))
    if len(actions) == 2:
        arms = inflect(_filled(rng, _pick(rng, CLAUSES[actions[1]]), hand), "ing")
        text += _pick(rng, JOINERS).format(ing=arms)
    if rng.uniform() < 0.5 and not SLOW <= speed <= FAST:
        text += _pick(rng, PACES["slow" if speed < SLOW else "fast"])
    text += _pick(rng, ENDINGS)
    return text + ("." if rng.uniform() < 0.15 else "")


def negative(rng: np.random.Generator, actions: tuple[str, ...]) -> str:
    """Words for something that a motion of these actions is not, preferably what its sentence leaves open."""
    rivals = sorted({a for named in OPEN_CLAUSES if actions[-1] in named for a in named} - set(actions))
    if not rivals or rng.uniform() < 0.3:
        rivals = sorted(set(CLAUSES) - set(actions))
    other = rivals[int(rng.integers(len(rivals)))]
    if rng.uniform() < 0.5:
        return _pick(rng, FRAGMENTS[other])
    clause = _filled(rng, _pick(rng, CLAUSES[other]), "")
    return inflect(clause, "ing") if rng.uniform() < 0.5 else _sentence(rng, clause)


def doing(action: str, hand: str = "") -> str:
    """The plainest clause of an action, as what is done beside something else: "raising the left arm"."""
    clause = re.sub(r"\[\?[^]]*\]", "", CLAUSES[action][0])
    return re.sub(r" +", " ", inflect(clause.replace("{hand}", hand), "ing")).strip()


def inflect(clause: str, form: str) -> str:
    """The clause with its verbs in `form`: "s" (raises), "ing" (raising) or "" (raise)."""

    def verb(match: re.Match[str]) -> str:
        word = match[1]
        if word in _STAY or not form:
            return word
        if form == "s":
            if word in _THIRD:
                return _THIRD[word]
            if re.search(r"(s|sh|ch|x|z)$", word):
                return word + "es"
            return word + "s"
        if re.search(r"[^aeiou]e$", word) or word.endswith("ue"):
            return word[:-1] + "ing"
        if re.search(r"[^aeiou][aeiou][bdgmnpt]$", word) and word not in {"wander", "fasten"}:
            return word + word[-1] + "ing"
        return word + "ing"

    return re.sub(r"<([a-z-]+)>", verb, clause)


def _sentence(rng: np.random.Generator, clause: str) -> str:
    """A clause with or without a subject."""
    kind = rng.uniform()
    if kind < 0.45:
        return f"{_pick(rng, SUBJECTS)} {inflect(clause, 's')}"
    if kind < 0.62:
        return f"{_pick(rng, SUBJECTS)} is {inflect(clause, 'ing')}"
    if kind < 0.82:
        return f"{_pick(rng, SUBJECTS)} {inflect(clause, 'ing')}"
    return inflect(clause, "ing" if kind < 0.92 else "")


def _filled(rng: np.random.Generator, clause: str, hand: str) -> str:
    """The clause with its optional words kept or dropped, and the hand said or left out."""
    clause = re.sub(r"\[\?([^]]*)\]", lambda m: m[1] if rng.uniform() < 0.5 else "", clause)
    if hand:
        return clause.replace("{hand}", hand)
    return re.sub(r" +", " ", clause.replace("{hand}", "")).replace("the  ", "the ")


def _pick(rng: np.random.Generator, options: tuple[str, ...]) -> str:
    return options[int(rng.integers(len(options)))]
