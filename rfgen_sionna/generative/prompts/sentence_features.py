"""Features of a sentence beside its vector: stems of its words, and hashed stems and pairs of stems."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence
from functools import cache
from itertools import pairwise
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

_SHORT = 5
"""Letters of the shortest word whose spelling is corrected."""
HASHED = 4096
"""Number of hashed features."""
_WORD = re.compile(r"[a-z]+(?:'[a-z]+)?")
_IRREGULAR = {
    form: base
    for base, forms in {
        "be": "is are was were am been being", "bend": "bent", "bring": "brought", "catch": "caught", "come": "came",
        "creep": "crept", "dive": "dove", "do": "does did done doing", "draw": "drew drawn", "drink": "drank drunk",
        "drive": "drove driven",
        "eat": "ate eaten", "fall": "fell fallen", "fly": "flew flown", "get": "got gotten", "give": "gave given",
        "go": "went goes gone", "have": "has had", "hold": "held", "keep": "kept", "kneel": "knelt", "leap": "leapt",
        "lie": "lying lay lain lies", "lose": "lost", "make": "made", "ride": "rode ridden", "rise": "rose risen",
        "run": "ran", "shake": "shook shaken", "sing": "sang sung", "sink": "sank sunk", "sit": "sat",
        "sleep": "slept", "slide": "slid", "spin": "spun", "stand": "stood", "stick": "stuck", "strike": "struck",
        "sweep": "swept", "swim": "swam swum", "swing": "swung", "take": "took taken", "throw": "threw thrown",
        "write": "wrote written", "foot": "feet", "tooth": "teeth", "man": "men", "woman": "women",
        "child": "children", "spread": "spread", "toe": "toes", "tie": "ties tying tied", "type": "typing typed",
        "shoe": "shoes", "knee": "knees", "pose": "poses posing", "move": "movement movements",
    }.items()
    for form in forms.split()
}  # fmt: skip
_SPELLED = (("practise", "practice"), ("colour", "color"), ("neighbour", "neighbor"), ("centre", "center"),
            ("metre", "meter"), ("anticlockwise", "counterclockwise"), ("grey", "gray"))  # fmt: skip
COMMON = frozenset(
    [
        "a",
        "an",
        "the",
        "of",
        "to",
        "in",
        "on",
        "at",
        "by",
        "for",
        "with",
        "as",
        "from",
        "into",
        "onto",
        "over",
        "under",
        "up",
        "down",
        "out",
        "off",
        "and",
        "or",
        "while",
        "then",
        "that",
        "who",
        "which",
        "it",
        "its",
        "he",
        "she",
        "they",
        "him",
        "her",
        "his",
        "their",
        "them",
        "one's",
        "i",
        "you",
        "my",
        "your",
        "our",
        "we",
        "me",
        "us",
        "this",
        "these",
        "those",
        "some",
        "is",
        "be",
        "am",
        "are",
        "person",
        "people",
        "human",
        "someone",
        "somebody",
        "one",
        "man",
        "woman",
        "men",
        "women",
        "boy",
        "girl",
        "child",
        "kid",
        "there",
        "here",
        "again",
        "it's",
    ]
)


def words(text: str) -> list[str]:
    """Words in small letters, in one spelling."""
    text = text.lower().replace("’", "'")
    text = re.sub(
        r"\bcounter[- ]?clock ?wise", "counterclockwise", re.sub(r"\banti[- ]?clock ?wise", "anticlockwise", text)
    )
    text = re.sub(r"\bt[- ]?(?=pos)", "tee ", re.sub(r"\by[- ]?(?=pos)", "why ", text))
    for british, american in _SPELLED:
        text = text.replace(british, american)
    return [word.removesuffix("'s") for word in _WORD.findall(text)]


@cache
def stem(word: str) -> str:
    """Word without the endings of English verbs and plurals: "hopping", "hops" and "hopped" are "hop"."""
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    for ending, least in (("ing", 3), ("ed", 3), ("es", 3), ("s", 3), ("ly", 4)):
        if word.endswith(ending) and len(word) - len(ending) >= least and not word.endswith("ss"):
            word = word[: -len(ending)]
            if word in _IRREGULAR:
                return _IRREGULAR[word]
            break
    if len(word) > 3 and word[-1] == word[-2] and word[-1] in "bdgmnprt":
        word = word[:-1]
    if word.endswith("i"):
        word = word[:-1] + "y"
    return word[:-1] if word.endswith("e") and len(word) > 3 else word


def respelled(text: str, known: Collection[str], is_word: Callable[[str], bool]) -> str:
    """The text with longer words that are none made known: two letters exchanged, one lost or added.

    Args:
        text: in small letters.
        known: words that others may become.
        is_word: whether any word is right as it is.
    """

    def corrected(match: re.Match[str]) -> str:
        word = match.group()
        if word in known or is_word(word) or is_word(word.removesuffix("s")):
            return word
        halves = [(word[:place], word[place:]) for place in range(1, len(word) + 1)]
        near = (
            *(a + b[1] + b[0] + b[2:] for a, b in halves if len(b) > 1),
            *(a + b[1:] for a, b in halves if len(b) > 1 and len(word) > _SHORT),
            *(a + letter + b for a, b in halves for letter in "abcdefghijklmnopqrstuvwxyz"),
        )
        return next((each for each in near if each in known), word)

    return re.sub(rf"\b[a-z]{{{_SHORT},}}\b", corrected, text)


def stems(text: str) -> list[str]:
    """Stems of all words, in their order."""
    return [stem(word) for word in words(text)]


def content(text: str) -> list[str]:
    """Words that carry meaning, in their order."""
    return [word for word in words(text) if word not in COMMON]


def hashed(text: str) -> NDArray[np.int64]:
    """Indices (feature,) of stems and pairs of neighbouring stems, without common words; each index once."""
    said = [stem(word) for word in content(text)]
    every = stems(text)
    pairs = [f"{a} {b}" for a, b in pairwise(every) if not {a, b} <= COMMON]
    gaps = [f"{a} _ {b}" for a, b in pairwise(said)]
    return np.unique([crc32(key.encode()) % HASHED for key in (*said, *pairs, *gaps)]).astype(np.int64)


def design(vectors: NDArray[np.float32], texts: Sequence[str]) -> NDArray[np.float32]:
    """Inputs (text, width + `HASHED`) of the head: vectors, and hashed features of length at most 1."""
    table = np.zeros((len(texts), HASHED), np.float32)
    for row, text in enumerate(texts):
        indices = hashed(text)
        if len(indices):
            table[row, indices] = 1.0 / np.sqrt(len(indices))
    return np.concatenate([vectors, table], axis=1)
