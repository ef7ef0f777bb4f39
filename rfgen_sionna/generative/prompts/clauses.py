"""Clauses of a sentence about actions: split, joined, and refused where they negate, ask or only consider."""

# Tables of patterns read best with one phrase to a line.
# ruff: noqa: E501

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from rfgen_sionna.generative.prompts import sentence_features
from rfgen_sionna.generative.prompts.human_nouns import PERSON

ARMS = frozenset(
    [
        "arm_circles",
        "both_arms_raised",
        "both_arms_forward",
        "circle_clockwise",
        "circle_counterclockwise",
        "clap",
        "click",
        "drink",
        "finger_swing",
        "left_arm_horizontal",
        "left_arm_raised",
        "phone",
        "point",
        "pull",
        "punch",
        "push",
        "right_arm_horizontal",
        "right_arm_raised",
        "swing_arms",
        "swipe_left",
        "swipe_right",
        "t_pose",
        "type",
        "wave",
        "y_pose",
        "beckon",
        "salute",
        "arms_folded",
        "arms_on_hips",
        "hands_behind_back",
        "hands_in_pockets",
        "boxing",
        "knock",
        "cough",
    ]
)
"""Actions of the arms, which go with those of `LEGS`."""
LEGS = frozenset(
    [
        "walk",
        "walk_straight",
        "walk_backwards",
        "walk_in_a_circle",
        "walk_to_and_fro",
        "walk_turn",
        "run",
        "run_backwards",
        "march",
        "march_in_place",
        "jog_on_the_spot",
        "sidestep",
        "sit",
        "kneel",
        "jump",
        "hop",
        "skip",
        "limp",
        "sneak",
        "left_leg_raised",
        "right_leg_raised",
        "crouch",
        "lie",
    ]
)
"""Actions and postures that leave the arms free."""
LEG_VERBS = {
    "walk": "walk",
    "stroll": "walk",
    "run": "run",
    "jog": "run",
    "sit": "sit",
    "kneel": "kneel",
    "march": "march",
    "hop": "hop",
}
"""Stems of verbs of `LEGS`, which may stand beside an action of the arms without a joint: "sits drinking tea"."""
_STAND, _FLOOR = {"standing", "stand_up"}, {"lie", "standing", "stand_up", "get_up"}
_WALKS = {"walk", "walk_straight", "walk_backwards", "walk_turn", "walk_to_and_fro", "turn_around"}
_COVERED: dict[str, set[str]] = {
    "sit_and_stand": {"sit", "sit_down", "get_up", *_STAND},
    "pick_up": {"bend", "crouch", "squat", "reach", "kneel", "lift", *_STAND},
    "put_down": {"bend", "crouch", "squat", "kneel", *_STAND},
    "fall_forward": {"stumble", "fall", "slip"},
    "fall": {"stumble", "fall_forward", "lie"},
    "fall_backward": {"fall"},
    "slip": {"fall", "fall_backward", "fall_forward"},
    "faint": {"fall", "lie", "fall_forward", "fall_backward", "fall_sideways"},
    "stumble": {"walk"},
    "leap": {"run", "jump", "hop"},
    "jump_twist": {"jump", "turn_around"},
    "jump_forward": {"jump"},
    "hop": {"jump", "left_leg_raised", "right_leg_raised"},
    "jump": {"crouch", "squat", "hop"},
    "walk_turn": _WALKS,
    "walk_to_and_fro": _WALKS,
    "squat": {"crouch", "bend", *_STAND},
    "bend": _STAND,
    "toe_touch": {"bend", *_STAND},
    "stretch": {"both_arms_raised", "t_pose", "y_pose"},
    "sit_down": {"turn_around", "sit"},
    "stand_up": {"sit"},
    "get_up": _FLOOR,
    "lie_down": {"lie"},
    "carry": {"walk", "walk_straight"},
    "boxing": {"punch"},
    "wave": {"left_arm_raised", "right_arm_raised", "both_arms_raised"},
    "throw": {"reach"},
    "lift": {"pick_up", "both_arms_raised"},
    "lunge": {"bend", "walk"},
    "sit_up": {"lie"},
    "push_up": {"lie"},
    "jumping_jacks": {"jump", "both_arms_raised", "t_pose", "y_pose", "clap"},
    "run": {"walk"},
    "limp": {"walk", "walk_straight"},
    "walk_in_a_circle": {"walk", "turn_around"},
    "walk_backwards": {"walk"},
    "walk_straight": {"walk"},
    "jog_on_the_spot": {"run", "march_in_place"},
    "run_backwards": {"run"},
    "sneak": {"walk", "crouch", "crawl"},
    "climb_stairs": {"walk"},
    "y_pose": {"both_arms_raised"},
    "both_arms_raised": {"y_pose"},
    "fall_from_chair": {"fall", "sit_down", "sit", "slip"},
    "march": {"walk"},
}
"""Action -> actions that are parts of it."""
_REQUEST = re.compile(
    r"^(?:(?:please|hi|hello|ok|okay|now)[ ,]+)*"
    r"(?:(?:can|could|would|will) you (?:please )?)?(?:please )?"
    r"(?:(?:i(?: would|'d)? (?:like|want|need)(?: you)? (?:to (?:see|have|get|simulate|generate|record) )?|let me see|let us see|let's see|give me|show(?: me)?|simulate|generate"
    r"|create|make(?= (?:me )?(?:a|an|some) (?:clip|video|recording|radar|simulation|motion|animation|sample|sequence|dataset|data|spectrogram))|produce|record|render|animate|synthesi[sz]e|model|imagine(?= an? ))(?: me)? )?"
    r"(?:(?:an?|the|some|radar|micro-doppler|mmwave|short|simulated|synthetic) )*"
    r"(?:(?:recording|video|clip|data|dataset|signature|scene|simulation|animation|sequence|sample|spectrogram|motion|movement|picture|action|activity|echo(?:es)?|return|measurement)s? (?:of|with|showing|where|in which|for|from|by|called) )?"
    r"(?:there(?: is|'s|s) )?"
)  # fmt: skip
_NEGATION = re.compile(
    r"\b(?:not|never|cannot|nobody|no one|none|neither|nor|nothing(?! but)|no longer|hardly|barely|refus(?:es|ed|ing)|avoid\w*|forbid\w*|forbidden|"
    r"prevent\w*|fail(?:s|ed|ing)? to|unable|instead of|except|rather than)\b|n't\b|\bwithout (?!moving|motion|getting|going|advancing|standing still|turning|stopping|pausing|a (?:break|pause|rest|stop)|rest|pause|leaving|hurry|falling|noise|making|any|lifting|bending|help|support|effort|shoes|end)"
)
_DOING_NOTHING = re.compile(
    r"(?:does|do|doing|is|are)(?: not|n't) (?:move|moving|do anything|doing anything|walk or)|not moving|does nothing|doing nothing|do nothing"
)
_QUESTION = re.compile(
    r"\?\s*$|^(?:who|what|why|where|when|how|which|is|are|does|do|did|can|could|should|shall|will|would|has|have)\b(?! jumping| squats| push)"
)
_CONSIDERED = re.compile(
    r"\b(?:wants?|wish(?:es)?|hopes?|plans?|intends?|hesitates?|dreams?|thinks?|thinking|dreaming|imagines?|imagining|pretends?|forgets?|promises?|likes?|loves?|hates?|prefers?|"
    r"would like|used|afraid|about|able|ready|learns?|learning|tries|try|trying|tried|decides?|threatens?|wanted|hoping|planning|needs?|has|have) (?:to|of) (?!the\b|a\b|an\b)\w+"
    r"|\b(?:almost|nearly) (?:falls?|fell|faints?|jumps?|sits?|stands?|walks?|runs?|slips?)\b|\b(?:stops?|stopped|quits?|stopping) (?:walking|running|dancing|jumping|waving|clapping|moving|sitting)"
    r"|\b(?:watch|see|hear|film|photograph|help|mak|let|order|teach|tell|ask|forc|observ)(?:e?s|ing|es)? (?:(?:a|an|the|his|her|their|somebody|someone|another|other) ?)(?:\w+ ){0,2}(?:to )?(?:walk|run|jump|danc|fall|sit|stand|wav|clap|play)\w*"
)
_AFTERWARDS = re.compile(
    r"\b(?:then|afterwards?|after that|next|finally|followed by|subsequently|later)\b|\b(?:before|after) (?:\w+ing|he|she|they)\b"
)
_JOINT = re.compile(
    r"\s*(?:;|, and then\b|\band then\b|, then\b|\bthen\b|\bfollowed by\b|\bafterwards\b|\band afterwards\b|\bbefore (?=\w+ing\b)|\bafter (?=\w+ing\b)|\band also\b|\bwhile simultaneously\b|\band at the same time\b|\bat the same time\b"
    r"|\bwhile\b|\bwhilst\b|\band\b|\bas (?=he\b|she\b|they\b)|,)\s*"
)
_PARTNER = re.compile(
    r"^(?:(?:the|his|her|their|a|an|both) )?(?:left|right|down|up|forth|fro|back|forwards?|backwards?|again|over|round|around|legs?|knees?|arms?|hands?|feet|foot|elbows?|out|apart|together|off|in|stand|cross|hooks?|wide|still|straight)\b(?: (?:arm|hand|leg|foot|knee|again|repeatedly|side|fist|kick|hook|elbow)s?)*$"
)

_SUBJECT = re.compile(
    rf"^(?:(?:there (?:is|was) )?(?:(?:an?|the|this|that|one|some|every|each) )?(?:[a-z-]+ ){{0,2}}?{PERSON}(?:'s)?|he|she|they|i|you|we|somebody|someone|anybody|everybody)"
    r"(?: (?:himself|herself|also|just|now|slowly|quickly))?(?:,? (?:who|that))?(?=[ ,])[ ,]+"
)
_POLITE = re.compile(r"\b(?:please|ok)\b,?|,? (?:once more|again please)$")
_NUMBER = re.compile(
    r"\b(?:\d+(?:[.,]\d+)?|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|fifteen|twenty|thirty|fifty|hundred) (?=[a-z])"
)

_PARTICIPLE = re.compile(
    r"\b((?:sits?|sitting|walks?|walking|stands?|standing|runs?|running|kneels?|kneeling|lies|lying)"
    r"(?: (?:at|on|in|by|there|around|along|about|still|quietly|the|a|an|his|her|their|table|desk|chair|sofa|couch|room|bed|floor|stool|window)\b)*)"
    r" (?!(?:sitting|standing|walking|running|lying|moving|doing|facing|waiting|going|wearing|being|turning|stopping|starting|morning|evening|ceiling|building|living|dining|meeting|waiting)\b)([a-z]+ing\b)"
)
"""A posture or a gait, and a participle beside it: "sits drinking tea"."""
ENDS = re.compile(
    r"^a person (?:lands?|stops?|pauses?|rests?|relaxes|repeats?|is (?:landing|stopping|pausing|resting))\b"
)
"""Clauses that only end or repeat an action."""
_ONE_WAY = re.compile(r"\b(?:up|back|to|backwards?|forwards?|left|right|round|over|there|again)$")
_OTHER_WAY = re.compile(r"(?:down|forth|fro|forwards?|backwards?|right|left|round|over|back|again)\b")
"""Halves of "up and down"."""


@dataclass(frozen=True)
class Clauses:
    """Clauses of a sentence."""

    texts: tuple[str, ...] = ()
    """Empty for one clause."""
    sequence: bool = False
    """Whether words say that one follows the other."""


def plain(text: str) -> str:
    """The sentence in small letters, without a request around it and without a full stop."""
    said = " ".join(text.lower().replace("’", "'").split()).rstrip(" .!,;:")
    return re.sub(_REQUEST, "", said, count=1) or said


def refusal(text: str) -> str:
    """Why a sentence names no action that is done: it negates, asks, or considers; else empty."""
    if (match := _NEGATION.search(_DOING_NOTHING.sub(" ", text))) is not None:
        return f"it negates something ({match.group().strip()!r})"
    if _QUESTION.search(text):
        return "it is a question"
    if (match := _CONSIDERED.search(text)) is not None:
        return f"nobody does it in {match.group()!r}"
    return ""


def split(text: str) -> Clauses:
    """Clauses at "and", "while", "then" and commas; pairs such as "left and right" stay together."""
    text = _PARTICIPLE.sub(r"\1 while \2", text)
    pieces: list[str] = []
    start = 0
    for match in _JOINT.finditer(text):
        left, right = text[start : match.start()].strip(), text[match.end() :].strip()
        following = _JOINT.split(right)[0] if right else ""
        if match.group().strip() in ("and", ",") and (
            _PARTNER.match(following) or (_ONE_WAY.search(left) and _OTHER_WAY.match(following))
        ):
            continue
        if sentence_features.words(left) and sentence_features.words(right):
            pieces.append(left)
            start = match.end()
    pieces.append(text[start:].strip())
    if len(pieces) < 2:
        return Clauses()
    pieces[1:] = [each if canonical(each).startswith("a person") else f"a person {each}" for each in pieces[1:]]
    return Clauses(tuple(pieces), _AFTERWARDS.search(text) is not None)


def covers(action: str, parts: Collection[str]) -> bool:
    """Whether an action consists of others."""
    return set(parts) <= {action, *_COVERED.get(action, ())}


def canonical(text: str) -> str:
    """The clause with "a person" as its subject, and without numbers and possessives.

    Args:
        text: in small letters.
    """
    said = re.sub(r"\b(?:his|her|their|its|my|your|our|one's|whose) (?=[a-z])", "the ", text)
    said = _NUMBER.sub("", _SUBJECT.sub("a person ", _POLITE.sub("", said), count=1))
    said = re.sub(r"^a person (?:who|that) (?:(?=is\b|was\b))?", "a person ", said)
    said = re.sub(r"^a person (?:is|was|are|am|were|has been) (?=\w+(?:ing|ed)\b)", "a person is ", said)
    return " ".join(said.split()).strip(" ,")
