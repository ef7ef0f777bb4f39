"""Reading of a prompt by the motion model: action, arms, hand and pace.

The sentence encoder knows words and actions but not which of two mirrored actions a sentence means ("to the left with
the right hand"). Regular expressions on the order of words decide that.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import torch

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, FRAGMENTS, LOWER, OPEN_CLAUSES, UPPER
from rfgen_sionna.generative.diffusion.sentence_encoder import HANDS, TextEncoder, stem, tokenise, words
from rfgen_sionna.generative.motion import ACTIONS
from rfgen_sionna.generative.prompts.text_reader import AFTERWARDS

_ARM = r"(?:hand|arm|palm|fist|finger|fore|index|wrist|elbow)"
_BOTH = re.compile(r"\b(?:hands|arms|palms|fists)\b|\b(?:both|two) (?:\w+ )?fingers\b")
_LEG = r"(?:leg|foot|knee|thigh)"
_NO_WAY = re.compile(
    rf"\b(?:left|right)[- ](?:{_ARM}|{_LEG})\w*"
    r"|\b(?:facing|faces|turned|turning|looking|looks)(?: to)?(?: the)? (?:left|right)\b"
    r"|\bfrom (?:the |his |her )?(?:left|right)\b"
    r"|(?<!to )(?<!the )\bright (?:in front|before|away|now|here|there|next|at)\b"
)
"""Sides that are no direction of movement."""
_TRUNK = r"(?:the |his |her |their |one's )?(?:chest|body|trunk|belly|shoulder)"
_TO_TRUNK = re.compile(rf"\b(?:to|towards?|against) {_TRUNK}|\b(?:to|towards?) (?:himself|herself|oneself|themselves)")
_FROM_TRUNK = re.compile(rf"\bfrom {_TRUNK}")
_ONWARDS = re.compile(r"\b(?:straight|forwards?|ahead|onwards?|towards?|away)\b")
_RETURNS = re.compile(r"\b(?:back|forth|backwards?|return\w*|there|around|about|turn\w*)\b")
_FINGER = re.compile(r"\b(?:fore)?fingers?\b")
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
"""Words without information on the action."""
_SURE = 0.82
"""Least probability of an action, with its alternatives, that needs no warning ..."""
_SURE_CAPTURED = 0.85
"""... of a captured action, which has few training sentences ..."""
_CERTAIN = 0.95
"""... of an action whose own words are a minority in the sentence ..."""
_PLAUSIBLE = 0.4
"""... and of a sentence in the action's own words."""
_OWN_SHARE = 2 / 3
"""Least share of the action's own words in such a sentence."""
_KIN = (
    ("walk", "walk_straight", "fast_walk", "slow_walk", "stride_walk"),
    ("pick_up", "bend_pick"),
    ("standing", "idle"),
    ("jump", "jump_repeat", "jump_balance", "jump_reach"),
    ("punch", "boxing"),
    ("dance", "dance_modern", "salsa", "indian_dance"),
)
"""Actions with common wordings, beside those of `OPEN_CLAUSES`."""
_OPEN = 0.5
"""Probability, relative to the likeliest action, from which another is an alternative."""
_GESTURES = frozenset(name for name, each in ACTIONS.items() if each.one_handed and name != "pick_up")
_MADE_WITH = re.compile(r"hand|arm|palm|fist|finger|wrist|gestur|swip|swep|sweep|push|pull|circl|click|tap|press")
"""Words that sentences about a gesture have; to swing, to draw and to move are ambiguous."""
_SUPPORT = re.compile(
    r"\bon (?:(?:the|his|her|their|one's|both|all) )*"
    r"(?:hands|knees|head|elbows|belly|back|fours|toes|tip-?toes?|heels)\b"
)
"""Supports that none of the twenty actions uses."""
_SECOND = re.compile(r"\s*(?:,|\bwhile\b|\band\b|\bthen\b|\bbefore (?=\w+ing\b)|\bwith\b)\s*")
"""Beginning of the second half of a sentence."""
_PACE = (0.8, 1.0, 1.2)
"""Factor on the usual speed for :data:`~rfgen_sionna.generative.diffusion.sentence_encoder.PACES`."""


def hand_named(prompt: str) -> str:
    """The one hand or arm in a sentence: "left", "right", or empty."""
    return _only(re.findall(rf"\b(left|right)[- ](?={_ARM})", prompt.lower()))


def both_hands_named(prompt: str) -> bool:
    """Whether a sentence names two hands or arms: "both hands", "his arms"."""
    return bool(_BOTH.search(prompt.lower()))


def direction_named(prompt: str) -> str:
    """The one direction of movement in a sentence: "left", "right", or empty."""
    return _only(re.findall(r"\b(left|right)(?:wards?)?\b", _NO_WAY.sub(" ", prompt.lower())))


def action_by_word_order(prompt: str, shares: Mapping[str, float]) -> str:
    """Action from the order of words, where the encoder confuses actions; empty where it does not.

    Args:
        prompt: the sentence.
        shares: the encoder's probability of every action.
    """
    said = prompt.lower()
    likeliest = max(shares, key=lambda a: shares[a])
    if likeliest in ("swipe_left", "swipe_right") and (way := direction_named(said)):
        return f"swipe_{way}"
    if likeliest in ("left_arm_raised", "right_arm_raised") and (hand := hand_named(said)):
        return f"{hand}_arm_raised"
    if likeliest in ("push", "pull"):
        inwards, outwards = bool(_TO_TRUNK.search(said)), bool(_FROM_TRUNK.search(said))
        return "" if inwards is outwards else "pull" if inwards else "push"
    if likeliest == "walk" and _ONWARDS.search(said) and not _RETURNS.search(said):
        return "walk_straight"
    if likeliest == "idle":
        # captured name of standing
        return "standing"
    if likeliest not in ("click", "finger_swing") and shares[likeliest] < 0.9 and _FINGER.search(said):
        return max(("click", "finger_swing"), key=lambda a: shares[a])
    return ""


def _only(sides: list[str]) -> str:
    return sides[0] if len(set(sides)) == 1 else ""


@dataclass(frozen=True)
class Understanding:
    """Reading of one prompt."""

    prompt: str
    action: str
    """Likeliest action."""
    share: float
    """Its probability."""
    arms: str = ""
    """Action of the arms at the same time, or empty."""
    hand: str = ""
    """"left", "right", "both", or empty where it is open or the action has none."""
    pace: float = 1.0
    """Requested factor on the usual speed."""
    options: tuple[str, ...] = ()
    """Possible actions, likeliest first."""
    shares: tuple[float, ...] = ()
    """Their probabilities."""
    unknown: tuple[str, ...] = ()
    """Content words outside the training sentences."""
    warnings: tuple[str, ...] = field(default=())
    ranking: tuple[str, ...] = ()
    """All actions, likeliest first."""
    rephrase: bool = False
    """Whether the sentence encoder missed hand or direction, so that a plainer sentence replaces the prompt."""

    @property
    def alternatives(self) -> list[tuple[str, float]]:
        """(action, probability) of the actions nearly as likely as the likeliest, which comes first."""
        pairs = zip(self.options, self.shares, strict=True)
        return [(a, s) for a, s in pairs if a in CLAUSES and s >= _OPEN * self.share]

    @property
    def known(self) -> bool:
        """Whether the prompt is within the vocabulary."""
        return not self.warnings


def understand(text: TextEncoder, prompt: str, known_stems: frozenset[str]) -> Understanding:
    """Reading of a prompt.

    Args:
        text: the model's encoder.
        prompt: one sentence.
        known_stems: stems of the training words.

    Raises:
        ValueError: the prompt has no words.
    """
    said = _read(text, prompt, known_stems)
    first, _, second = _SECOND.sub("\0", prompt, count=1).partition("\0")
    if not (words(first) and words(second)):
        return said
    begins, goes_on = _read(text, first, known_stems), _read(text, second, known_stems)
    if AFTERWARDS.search(prompt.lower()):
        if said.known and begins.known and goes_on.known and begins.action != goes_on.action:
            note = f"prompt: {prompt!r} names one action after another; nearest action: {begins.action}"
            return replace(begins, prompt=prompt, warnings=(note,))
        return said
    # training sentences combine arms with "walk" only: read the halves of other sentences separately
    legs, arms = (goes_on, begins) if begins.action in UPPER else (begins, goes_on)
    if not (legs.known and legs.action in LOWER and not legs.arms):
        return said
    if said.known and said.arms and legs.action != "walk_straight":
        return said
    if arms.known and arms.action in UPPER and arms.share >= _SURE:
        return replace(
            legs, prompt=prompt, arms=arms.action, hand=arms.hand or said.hand or hand_named(prompt), rephrase=True
        )
    if said.arms and legs.action == "walk_straight":
        return replace(legs, prompt=prompt, arms=said.arms, hand=said.hand, rephrase=True)
    return said


def _read(text: TextEncoder, prompt: str, known_stems: frozenset[str]) -> Understanding:
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
    decided = action_by_word_order(prompt, every)
    # the encoder confuses hand and direction of a swipe
    named = hand_named(prompt) if action.startswith("swipe") else ""
    rephrase = decided not in ("", action) or named not in ("", said_hand)
    if decided:
        action, options, share = decided, (decided,), together
    beside = int(arms.argmax())
    other = text.actions[beside] if beside < len(text.actions) and float(arms[beside]) > 0.5 else ""
    gesture = ACTIONS.get(other or action)
    if gesture is not None and "both" in gesture.hands and both_hands_named(prompt):
        named = "both"
    content = [w for w in said if w not in _PLAIN and not w.isdigit()]
    # twice for double endings: "springing"
    unknown = tuple(w for w in content if not {stem(w), stem(stem(w))} & known_stems)
    warnings: tuple[str, ...] = ()
    if not _is_clear(prompt.lower(), action, every, content, unknown, decided=bool(decided)):
        strange = f" ({', '.join(map(repr, unknown))} unknown)" if unknown else ""
        warnings = (f"prompt: {prompt!r} is outside the model's vocabulary{strange}; nearest action: {action}",)
    return Understanding(
        prompt,
        action,
        share,
        other,
        named or said_hand,
        _PACE[int(pace.argmax())] if float(pace.max()) > 0.6 else 1.0,
        options,
        (share,) if decided else tuple(every[a] for a in options),
        unknown,
        warnings,
        (action, *(a for a in order if a != action)),
        rephrase,
    )


def _is_clear(
    said: str, action: str, every: Mapping[str, float], content: list[str], unknown: tuple[str, ...], *, decided: bool
) -> bool:
    """Whether words mean an action, instead of being outside the vocabulary.

    On unknown words the encoder spreads its probability over unrelated actions. On new wordings of an action it may,
    too, but those consist of the action's words and names of things.
    """
    sure = sum(every.get(a, 0.0) for a in _left_open_with(action))
    learned = [w for w in content if w not in unknown]
    own = [w for w in learned if stem(w) in _wordings().get(action, ())]
    if action in CLAUSES and _SUPPORT.search(said):
        return False
    if action in _GESTURES and sure < _CERTAIN and not _MADE_WITH.search(said):
        return False
    if unknown and 2 * len(unknown) >= len(content):
        return sure >= _CERTAIN and bool(own)
    if sure >= (_SURE if action in CLAUSES else _SURE_CAPTURED):
        return sure >= _CERTAIN or action not in CLAUSES or 2 * len(own) >= len(content)
    return (decided or sure >= _PLAUSIBLE) and len(own) == len(learned) and len(own) >= _OWN_SHARE * len(content)


def _left_open_with(action: str) -> set[str]:
    """The action and those with common wordings."""
    return {action}.union(*(group for group in (*OPEN_CLAUSES, *_KIN) if action in group))


@cache
def _wordings() -> Mapping[str, frozenset[str]]:
    """Action of the phrase book -> stems of its wordings."""
    said = {action: [*clauses, *FRAGMENTS[action]] for action, clauses in CLAUSES.items()}
    for named, clauses in OPEN_CLAUSES.items():
        for action in named:
            said[action] += clauses
    return {action: stems(texts) for action, texts in said.items()}


def stems(texts: Iterable[str]) -> frozenset[str]:
    plain = (re.sub(r"[<>\[\]?{}]", " ", text) for text in texts)
    return frozenset(stem(word) for text in plain for word in words(text))


def known_reading(said: Understanding, action: str, arms: str) -> Understanding:
    """A reading with its action known: without alternatives or warnings, and rephrased where the words do not say
    it."""
    other = said.rephrase or not said.known or (said.action, said.arms) != (action, arms)
    return replace(said, action=action, arms=arms, options=(action,), shares=(said.share,), warnings=(), rephrase=other)


def ambiguous_actions(said: Understanding, denied: Understanding) -> list[tuple[str, float]]:
    """(action, probability) of a prompt's alternatives that the negative prompt leaves; empty where it excludes none or
    all."""
    options = [(a, s) for a, s in zip(said.options, said.shares, strict=True) if a in CLAUSES]
    left = [(a, s) for a, s in options if a not in denied.options]
    return left if 0 < len(left) < len(options) else []
