"""Clauses of the phrase book with their verbs in one form or another."""

from __future__ import annotations

import re

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES

_THIRD = {"do": "does", "go": "goes", "have": "has"}
_STAY = {"just"}


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
