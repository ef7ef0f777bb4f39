"""Sides and directions of actions by the order of words, where sentence encoders confuse them.

The action reader's head decides between families: "arm_raised" is the left or the right one here. A family that the
words leave open gives all its actions.
"""

# Tables of patterns read best with one phrase to a line.
# ruff: noqa: E501

from __future__ import annotations

import re

SIDES = ("left", "right")
_ARM = r"(?:arm|hand|palm|fist|wrist|elbow|index finger|forefinger|finger|upper limb|one)s?"
_LEG = r"(?:leg|foot|knee|thigh|ankle|heel|lower limb|one)s?"
_BETWEEN = r"(?: (?!and\b|or\b|then\b|to\b|while\b|on\b)\w+){0,2}?"
_SUPPORTS = re.compile(
    rf"\b(?:stand\w*|stood|balanc\w+|weight|rest\w*|hop\w*|stay\w*)\b.{{0,25}}?\bon (?:only )?(?:the |his |her |their |my |one's |its )?"
    rf"(left|right)\b(?:{_BETWEEN} {_LEG})?"
)
"""The leg that carries: the other one is raised."""
_NO_WAY = re.compile(
    rf"\b(?:left|right){_BETWEEN} {_ARM}\b|\bfrom (?:the |his |her |their )?(?:left|right)\b"
    r"|\b(?:hand|arm) (?:left|right)\b(?! to)"
    r"|(?<!to )(?<!the )\bright (?:in front|before|away|now|here|there|next|at)\b"
)
"""Sides that are no direction of movement."""
_FALL_WAYS = (
    ("fall_from_chair", r"\b(?:from|off|out of|in|with) (?:of )?(?:a |the |his |her |their |its |my |an )?(?:\w+ )?(?:chair|stool|seat|sofa|couch|bench|armchair|wheelchair)\b"),
    ("fall_backward", r"\bback(?:wards?)?\b(?! (?:up|to))|\bsupine\b|\b(?:on|onto|to) (?:the |his |her |their )?(?:back|backside|behind|bottom)\b"),
    ("fall_forward", r"\bforwards?\b|\bahead\b|\bprone\b|\bheadlong\b|\bface (?:first|down)\b|\b(?:on|onto|to) (?:the |his |her |their )?(?:face|nose|stomach|belly|chest|knees|hands)\b|\b(?:trip|stumbl)\w*"),
    ("fall_sideways", r"\bside(?:ways?|wards?)?\b|\b(?:left|right)\b|\blaterally\b|\bhip\b"),
)  # fmt: skip
_CHANGES = (
    ("stand_up", r"\b(?:sits(?! down)|sitting(?! down)|seated)\b.* (?:and|then|before) .*\b(?:(?:stands|gets|standing|getting) up|rises)$"),
    ("sit_down", r"\b(?:stands(?! up)|standing(?! up)|upright)\b.* (?:and|then|before) .*\b(?:sits|sitting) down(?: on a (?:chair|seat|sofa))?$"),
)  # fmt: skip
"""One change between sitting and standing, from a posture that the words give."""
FAMILIES = {
    "arm_raised": ("left_arm_raised", "right_arm_raised"),
    "arm_horizontal": ("left_arm_horizontal", "right_arm_horizontal"),
    "leg_raised": ("left_leg_raised", "right_leg_raised"),
    "swipe": ("swipe_left", "swipe_right"),
    "circle": ("circle_clockwise", "circle_counterclockwise"),
    "kick": ("kick", "left_kick", "right_kick"),
    "fall": ("fall", "fall_forward", "fall_backward", "fall_sideways", "fall_from_chair"),
}
"""Family -> its actions."""
KINDS = {
    **dict.fromkeys(("walk_straight", "walk_to_and_fro", "walk_turn", "walk_in_a_circle"), "walk"),
    **dict.fromkeys(("jump_forward", "jump_twist"), "jump"),
    "sit_down_heavily": "sit_down",
    "boxing": "punch",
}
"""Action -> the action that it is a kind of: whatever shows the first shows the second."""
_PAIRS = {"arm_raised": "both_arms_raised", "arm_horizontal": "t_pose"}
"""Family of one arm -> action of both."""


def actions_of(family: str, text: str) -> tuple[str, ...]:
    """Actions that the words leave open, of a family or of an action that is none.

    Args:
        family: output of the action reader's head.
        text: the sentence, in small letters.
    """
    if family in ("sit", "lie") and re.search(rf"\b{family}s? down\b|\bsitting down\b", text):
        return (f"{family}_down",)
    if family == "lie_down" and re.search(
        r"\b(?:lies|lying) (?:face|flat|prone|supine|still|curled|on|in|there)\b", text
    ):
        return ("lie",)
    if family == "sit_and_stand":
        return next(((action,) for action, pattern in _CHANGES if re.search(pattern, text)), (family,))
    if family == "sit_down" and re.search(r"\b(?:sits|sitting|seated) (?:at|on|in|by|still|there)\b", text):
        return ("sit",)
    if family not in FAMILIES:
        return (family,)
    if family == "kick":
        side = _only(
            _limbs(text, _LEG)
            or re.findall(r"\b(left|right)\b(?=[ -](?:kick|front kick|side kick|roundhouse)|$)", text)
        )
        return (f"{side}_kick",) if side else ("kick",)
    if family == "fall":
        ways = [action for action, pattern in _FALL_WAYS if re.search(pattern, text)]
        return (ways[0],) if ways else ("fall",)
    if family == "circle":
        turns = set(re.findall(r"\b((?:counter|anti)?)[- ]?clock ?wise\b", text))
        options = FAMILIES[family]
        return options if len(turns) != 1 else options[1:] if turns.pop() else options[:1]
    if family == "swipe":
        way = _only(re.findall(r"\b(left|right)(?:wards?)?\b", _NO_WAY.sub(" ", text.replace("-to-", " to "))))
        return (f"swipe_{way}",) if way else FAMILIES[family]
    if family == "leg_raised":
        support = _only(_SUPPORTS.findall(text))
        raised = _only(_limbs(_SUPPORTS.sub(" ", text), _LEG))
        side = raised or {"left": "right", "right": "left"}.get(support, "")
    else:
        named = set(_limbs(text, _ARM)) or set(re.findall(r"\b(left|right)\b", text))
        if len(named) == 2 and not re.search(r"\bor\b|\bnot\b", text):
            return (_PAIRS[family],)
        side = _only(sorted(named))
    return tuple(action for action in FAMILIES[family] if side in action)


def limb_side(text: str) -> str:
    """The one side in a sentence, of a limb or a way: "left", "right" or empty."""
    return _only(re.findall(r"\b(left|right)(?:wards?)?\b", text))


def _limbs(text: str, limb: str) -> list[str]:
    """Sides of limbs in a sentence; "left and right arm" has both."""
    pairs = re.findall(rf"\b(left|right)(?: and (?:the |his |her |their )?| or )(left|right){_BETWEEN} {limb}\b", text)
    single = re.findall(rf"\b(left|right)(?:[- ]{limb}\b|{_BETWEEN} {limb}\b|[- ](?:arm|leg|hand|foot)ed\b)", text)
    return [side for pair in pairs for side in pair] + single


def _only(sides: list[str]) -> str:
    return sides[0] if len(set(sides)) == 1 else ""
