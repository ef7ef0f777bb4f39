"""What a bag of word pieces mixes up and words and their order tell: whose side is whose, one hand or both, from where
to where.

"to the left with the right hand", "from the chest to the front": the sentence encoder knows the words and the action,
and half of the time not which of two mirrored ones it is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

_ARM = r"(?:hand|arm|palm|fist|finger|fore|index|wrist|elbow)"
_BOTH = re.compile(r"\b(?:hands|arms|palms|fists)\b|\b(?:both|two) (?:\w+ )?fingers\b")
_LEG = r"(?:leg|foot|knee|thigh)"
_NO_WAY = re.compile(
    rf"\b(?:left|right)[- ](?:{_ARM}|{_LEG})\w*"
    r"|\b(?:facing|faces|turned|turning|looking|looks)(?: to)?(?: the)? (?:left|right)\b"
    r"|\bfrom (?:the |his |her )?(?:left|right)\b"
    r"|(?<!to )(?<!the )\bright (?:in front|before|away|now|here|there|next|at)\b"
)
"""Sides that are not where something goes."""
_TRUNK = r"(?:the |his |her |their |one's )?(?:chest|body|trunk|belly|shoulder)"
_TO_TRUNK = re.compile(rf"\b(?:to|towards?|against) {_TRUNK}|\b(?:to|towards?) (?:himself|herself|oneself|themselves)")
_FROM_TRUNK = re.compile(rf"\bfrom {_TRUNK}")
_ONWARDS = re.compile(r"\b(?:straight|forwards?|ahead|onwards?|towards?|away)\b")
_RETURNS = re.compile(r"\b(?:back|forth|backwards?|return\w*|there|around|about|turn\w*)\b")
_FINGER = re.compile(r"\b(?:fore)?fingers?\b")


def hand_named(prompt: str) -> str:
    """The one hand or arm that a sentence names: "left", "right", or empty."""
    return _only(re.findall(rf"\b(left|right)[- ](?={_ARM})", prompt.lower()))


def both_hands_named(prompt: str) -> bool:
    """Whether a sentence names two hands or arms: "both hands", "his arms"."""
    return bool(_BOTH.search(prompt.lower()))


def direction_named(prompt: str) -> str:
    """The one side to which something goes in a sentence: "left", "right", or empty."""
    return _only(re.findall(r"\b(left|right)(?:wards?)?\b", _NO_WAY.sub(" ", prompt.lower())))


def action_by_word_order(prompt: str, shares: Mapping[str, float]) -> str:
    """The action that the order of words tells among those which the encoder mixes up, or empty where it tells none.

    Args:
        prompt: the sentence.
        shares: every action's probability, as the encoder has it.
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
        # what captured people who stand are called
        return "standing"
    if likeliest not in ("click", "finger_swing") and shares[likeliest] < 0.9 and _FINGER.search(said):
        return max(("click", "finger_swing"), key=lambda a: shares[a])
    return ""


def _only(sides: list[str]) -> str:
    return sides[0] if len(set(sides)) == 1 else ""
