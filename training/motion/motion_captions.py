"""Sentences for actions, drawn from the phrase book."""

from __future__ import annotations

import re
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, FRAGMENTS, OPEN_CLAUSES, inflect
from rfgen_sionna.generative.diffusion.understanding import stems

SUBJECTS = (
    *("a person",) * 8,
    *("the person", "someone", "somebody", "a man", "a woman", "a human", "an adult", "a boy", "a girl", "a child"),
    *("he", "she", "a pedestrian", "the subject", "an old man", "a young woman", "a tall man", "one person", "a guy"),
)
ENDINGS = (
    *("",) * 12,
    *(" in front of the radar", " in a room", " in a repetitive manner", " repeatedly", " again and again"),
    *(" facing the radar", ", facing forward", " at 3 m", " in a living room", " several times", " facing left"),
    *(", side view", " while facing the sensor", " once", " over and over"),
)
PACES = MappingProxyType(
    {
        "slow": (" slowly", " at a slow pace", " leisurely", " very slowly", " gently"),
        "fast": (" quickly", " fast", " rapidly", " briskly", " at a fast pace"),
    }
)
"""Ways to say the speed."""
JOINERS = (" while {ing}", " and {ing}", " while {ing} at the same time", ", {ing}")
SLOW, FAST = 0.87, 1.15
"""Speeds beyond which a sentence may say that it is slow or fast."""


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


def vocabulary(captions: tuple[str, ...] = ()) -> frozenset[str]:
    """Stems of all words of the phrase book and of these captions."""
    texts = [*SUBJECTS, *captions, *(p for group in PACES.values() for p in group)]
    for table in (CLAUSES, FRAGMENTS, OPEN_CLAUSES):
        texts += [clause for clauses in table.values() for clause in clauses]
    return stems(texts)
