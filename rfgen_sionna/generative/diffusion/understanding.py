"""What the model makes of a prompt before it moves."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import torch

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.text import HANDS, TextEncoder, stem, tokenise, words
from rfgen_sionna.generative.diffusion.word_order import hand_named, told_by_words
from rfgen_sionna.generative.diffusion.wording import FRAGMENTS, OPEN_CLAUSES, PACES, SUBJECTS

_PLAIN = frozenset(
    word
    for group in (
        ("a", "an", "the", "of", "is", "are", "be", "being", "and", "or", "with", "while", "who", "that", "which"),
        ("in", "on", "at", "to", "into", "by", "for", "as", "from", "up", "down", "out", "off", "over", "then", "one"),
        ("it", "its", "he", "she", "they", "his", "her", "their", "person", "people", "someone", "somebody"),
        ("m", "metre", "metres", "meter", "meters", "front", "room", "radar", "sensor", "camera", "about", "around"),
        ("man", "woman", "men", "women", "lady", "fellow", "guy", "kid", "boy", "girl", "human", "adult", "child"),
        ("old", "young", "tall", "short", "facing", "there", "again", "repeatedly"),
        ("do", "does", "doing", "make", "making", "perform", "performs", "performing"),
        ("repetitive", "repetitively", "manner", "way", "several", "times", "time", "once", "twice", "living"),
        ("when", "where", "what", "side", "view", "towards", "toward", "before", "some", "this", "these", "those"),
    )
    for word in group
)
"""Words that say nothing about the action."""
_SURE = 0.35
"""Probability from which the nearest action is taken without a warning."""
_OPEN = 0.5
"""Share of the likeliest action's probability from which another counts as meant, too."""
_PACE = (0.8, 1.0, 1.2)
"""Factor on the usual speed for `text.PACES`."""


@dataclass(frozen=True)
class Understanding:
    """The reading of one prompt."""

    prompt: str
    action: str
    """The likeliest action."""
    share: float
    """Its probability."""
    arms: str = ""
    """What the arms do beside, or empty."""
    hand: str = ""
    pace: float = 1.0
    """Factor on the usual speed that the words ask for."""
    options: tuple[str, ...] = ()
    """The actions that the words leave open, likeliest first."""
    shares: tuple[float, ...] = ()
    """Their probabilities."""
    unknown: tuple[str, ...] = ()
    """Content words that no training sentence had."""
    warnings: tuple[str, ...] = field(default=())
    ranking: tuple[str, ...] = ()
    """All actions, likeliest first."""
    rephrase: bool = False
    """Whether the sentence encoder missed which hand or which way is meant, so that plainer words serve it better."""

    @property
    def alternatives(self) -> list[tuple[str, float]]:
        """(action, probability) of the actions that are nearly as likely as the likeliest, which comes first."""
        pairs = zip(self.options, self.shares, strict=True)
        return [(a, s) for a, s in pairs if a in CLAUSES and s >= _OPEN * self.share]

    @property
    def known(self) -> bool:
        """Whether the prompt is within the vocabulary."""
        return not self.warnings


def vocabulary(captions: tuple[str, ...] = ()) -> frozenset[str]:
    """Stems of all words of the phrase book and of these captions."""
    texts = [*SUBJECTS, *captions, *(p for group in PACES.values() for p in group)]
    for table in (CLAUSES, FRAGMENTS, OPEN_CLAUSES):
        texts += [clause for clauses in table.values() for clause in clauses]
    plain = (re.sub(r"[<>\[\]?{}]", " ", text) for text in texts)
    return frozenset(stem(word) for text in plain for word in words(text))


def understand(text: TextEncoder, prompt: str, known_stems: frozenset[str]) -> Understanding:
    """Read a prompt.

    Raises:
        ValueError: the prompt has no words.
    """
    said = words(prompt)
    if not said:
        raise ValueError(f"prompt: {prompt!r} has no words")
    with torch.no_grad():
        pooled = text(tokenise([prompt])).pooled
        chance, arms, hand, pace = (
            head(pooled)[0].softmax(-1) for head in (text.action, text.arms, text.hand, text.pace)
        )
    every = {a: float(c) for a, c in zip(text.actions, chance, strict=True)}
    said_hand = HANDS[int(hand.argmax())]
    order = sorted(every, key=lambda a: -every[a])
    action, share = order[0], every[order[0]]
    options = tuple(a for a in order[:6] if every[a] > 0.15 * share)
    together = sum(every[a] for a in options)
    told = told_by_words(prompt, every)
    # the encoder's hand is that of the swipe's way as often as not
    named = hand_named(prompt) if action.startswith("swipe") else ""
    rephrase = told not in ("", action) or named not in ("", said_hand)
    if told:
        action, options, share = told, (told,), together
    beside = int(arms.argmax())
    content = [w for w in said if w not in _PLAIN and not w.isdigit()]
    unknown = tuple(w for w in content if stem(w) not in known_stems)
    warnings: tuple[str, ...] = ()
    if together < _SURE or (content and 2 * len(unknown) >= len(content)):
        strange = f" ({', '.join(map(repr, unknown))} unknown)" if unknown else ""
        warnings = (f"prompt: {prompt!r} is outside what the model has learned{strange}; nearest action: {action}",)
    return Understanding(
        prompt,
        action,
        share,
        text.actions[beside] if beside < len(text.actions) and float(arms[beside]) > 0.5 else "",
        named or said_hand,
        _PACE[int(pace.argmax())] if float(pace.max()) > 0.6 else 1.0,
        options,
        (share,) if told else tuple(every[a] for a in options),
        unknown,
        warnings,
        (action, *(a for a in order if a != action)),
        rephrase,
    )
