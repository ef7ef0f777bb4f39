"""Manner in a prompt: pace, speed, size, repetitions a minute, way, pauses, posture of the arms, tiredness."""

# A table of patterns reads best with one phrase to a line.
# ruff: noqa: E501, ISC004

from __future__ import annotations

import re

from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.quantities import RATE, SPEED, Quantity
from rfgen_sionna.generative.prompts.text_reader import Reader, limits
from rfgen_sionna.generative.prompts.vocabulary import RADAR

PACES: tuple[tuple[float, str], ...] = (
    (0.5, r"at half (?:the )?(?:normal |usual )?speed|half as fast"),
    (2.0, r"at (?:double|twice) (?:the )?(?:normal |usual )?speed|twice as fast"),
    (
        0.7,
        r"(?:at|with|in) <a>(?:slow|leisurely|gentle|unhurried|low|calm|relaxed) (?:speed|pace|tempo|rhythm|manner|way|motion)",
    ),
    (
        1.3,
        r"(?:at|with|in) <a>(?:fast|quick|brisk|rapid|swift|high) (?:speed|pace|tempo|rhythm|manner|way|motion)|in a (?:hurry|rush)",
    ),
    (
        1.0,
        r"(?:(?:at|with|in) )?<a>(?:normal|usual|ordinary|medium|moderate|natural|average|comfortable|steady|constant|regular|preferred|self selected) (?:speed|pace|tempo|rhythm)",
    ),
    (0.5, r"(?:very|extremely|really) (?:slowly|slow)|in slow motion"),
    (
        1.6,
        r"(?:very|extremely|really) (?:quickly|quick|fast|rapidly)|as (?:fast|quickly) as (?:possible|he can|she can|they can)|at (?:full|top|maximum|max|high) speed|at full tilt",
    ),
    (0.7, r"slowly|slow|leisurely|gently|gentle|unhurriedly|calmly|lazily"),
    (
        1.3,
        r"quickly|quick|fast|rapidly|rapid|briskly|brisk|swiftly|swift|hurriedly|hastily|energetically|vigorously|hurry(?:ing)? up",
    ),
)
"""(factor on the usual speed, pattern); nouns come before the verb "pace"."""
_MOVEMENT = (
    r"(?:steps?|strides?|jumps?|hops?|leaps?|bounces?|swings?|swipes?|circles?|waves?|kicks?|punch(?:es)?|gestures?|movements?|motions?"
    r"|moves|bows?|squats?|lunges?|pushes|pulls|claps?|nods?|turns?|twists?|amplitude|arm (?:swings?|movements?|circles?)|leg (?:swings?|movements?)"
    r"|hand (?:movements?|gestures?)|jumping jacks|star jumps|range of motion)"
)
_SIZES: tuple[tuple[float, str], ...] = (
    (0.4, r"tiny|minimal|very small|very short|very low"),
    (1.7, r"huge|enormous|very (?:big|large|wide|high|long)"),
    (0.6, r"small|little|short|low|slight|shallow|narrow|subtle|restrained"),
    (1.4, r"big|large|wide|high|long|deep|exaggerated|expansive|sweeping"),
)
AMPLITUDES: tuple[tuple[float, str], ...] = (
    *(
        (
            factor,
            rf"(?:with|in|using|making|makes) <a>(?:{words}) (?:movements?|motions?|gestures?|amplitudes?|range of motion)",
        )
        for factor, words in _SIZES
    ),
    *(
        (
            factor,
            rf"(?<!in )(?<!in a )(?<!along a )(?<!around a )(?:{words})(?: ,)?(?= (?:[a-z~]+ ){{0,2}}?{_MOVEMENT}(?!\w))",
        )
        for factor, words in _SIZES
    ),
    (
        0.6,
        r"(?<=jumps )(?:low|slightly)|(?<=jumping )(?:low|slightly)|(?<=hops )(?:low|slightly)|(?<=hopping )(?:low|slightly)|slightly(?! (?:turned|rotated|to|left|right|older|taller|overweight)\b)|a (?:little )?bit|subtly",
    ),
    (
        1.4,
        r"(?<=jumps )high|(?<=jumping )high|(?<=jump )high|(?<=hops )high|(?<=hopping )high|(?<=kicks )high|(?<=kicking )high|widely|with (?:big|large|wide|full) (?:amplitude|range)",
    ),
)
"""(factor on the usual size, pattern)."""
_PERIOD = r"(?P<per>second|sec|minute|min|hour)"
RATES: tuple[str, ...] = (
    rf"(?:(?:at|about|with) )?<a>(?:(?:rate|cadence|frequency|rhythm) of )?(?P<value><r>|once|twice)(?: (?:times|repetitions|reps|cycles|steps|strides|(?P<kept>(?!(?:m|cm|km|ft|feet|degrees|miles|kg|kilomet(?:re|er)s|met(?:re|er)s|rotations?|breaths|beats)\b)[a-z]+(?: [a-z]+)?)))? (?:a|an|per|each|every) {_PERIOD}",
    r"(?:once )?every (?P<seconds><r>|other)? ?(?:seconds?|secs?)",
    r"(?:(?:at|with) )?<a>(?:(?:rate|frequency) of )?(?P<value><r>) (?P<per>hz|hertz)",
)
PATHS: tuple[tuple[str, str], ...] = (
    (
        "to_and_fro",
        rf"back and forth|back and forwards?|to and fro|forwards? and backwards?|forth and back|backwards? and forwards?|forwards? and then back(?:wards?)?|up and down"
        rf"|from side to side|towards? and away from {RADAR}|(?:(?:towards?|up to|to) {RADAR}|away(?: from {RADAR})?) and (?:then )?(?:(?:<walk>|<go|went>|<come|came>|<move>|<run|ran>) )?(?:back|away(?: from (?:it|{RADAR}))?)(?: again)?",
    ),
    (
        "circle",
        r"(?:in|along|around|round) (?:a |the )?(?:(?:small|big|large|wide|closed) )?circles?|in rings?|in rounds|circling|round and round",
    ),
    (
        "loop",
        r"(?:in|along|around) (?:a |the )?(?:(?:closed|big|large) )?loops?(?: (?:around|round|through|in) (?:the|a) (?:[a-z]+ )?(?:room|place|hall|floor|office|lab|house|field|street))?"
        r"|(?:a |one )?(?:loops?|laps?|rounds?) (?:around|round|through|in|of) (?:the|a) (?:[a-z]+ )?(?:room|place|hall|floor|office|lab|house|field)|(?:all )?(?:around|round|about|through) the (?:whole |entire )?room",
    ),
    ("straight", r"straight(?: ahead| on| forwards?)?|in a straight line|along a (?:straight )?line|straight line"),
)
"""(way over the floor, pattern); the words stay in the phrase of the action."""
_NOW_AND_THEN = (
    r"(?:in between|between (?:steps|them)|now and then|now and again|every now and then|from time to time|occasionally|sometimes"
    r"|every few (?:steps|seconds|met(?:re|er)s)|repeatedly|several times|on the way|at times)"
)
PAUSES = (
    rf"(?:and )?(?:with|making|taking|including|makes|takes) (?:(?:some|short|brief|occasional|a few|several|regular|frequent|long|a|the) )*(?:pauses?|breaks?|stops|rests)(?: {_NOW_AND_THEN})?"
    rf"|(?:and |while )?(?:pausing|stopping|halting|resting|pauses|stops|halts|rests) {_NOW_AND_THEN}"
    r"|(?:occasionally|sometimes|repeatedly) (?:pausing|stopping|halting|pauses|stops)|stop and go|with interruptions|intermittently|(?:and )?pausing|and (?:(?:some|short|brief|occasional|a few|several) )*pauses?"
)
"""Stops on the way."""
_HIS = r"(?:<a>)"
_ARMS, _HANDS = r"(?:(?:both|two) )?<a>(?:own )?arms", r"(?:(?:both|two) )?<a>(?:own )?hands"
_WITH = r"(?:(?:and |while )?(?:with|keeping|holding|having|letting|keeps|holds|lets) )?"
POSTURES: tuple[tuple[str, str], ...] = (
    (
        "hanging",
        rf"{_WITH}{_ARMS} (?:are )?(?:(?:loosely|just|simply) )?(?:<hang|hung|hanging>(?: (?:down|loosely|freely|straight down|limply|at the sides?|at (?:his|her|their) sides?|by (?:his|her|their) sides?))*|dangling|down(?: (?:at|by) {_HIS}sides?)?|relaxed|(?:at|by) {_HIS}sides?)",
    ),
    ("hanging", rf"{_WITH}(?:hanging|dangling|relaxed) arms"),
    (
        "on_hips",
        rf"{_WITH}(?:{_HANDS}|{_ARMS}) (?:are )?(?:(?:resting|placed|put|held) )?(?:on|at|onto) {_HIS}(?:hips?|waist)|(?:with )?arms akimbo|akimbo",
    ),
    (
        "folded",
        rf"{_WITH}{_ARMS} (?:are )?(?:folded|crossed)(?: (?:in front of|over|across|on) {_HIS}(?:chest|body|breast))?|{_WITH}(?:folded|crossed) arms",
    ),
    (
        "behind_back",
        rf"{_WITH}(?:{_HANDS}|{_ARMS}) (?:are )?(?:(?:clasped|held|folded|crossed|locked) )?(?:behind|at|on) {_HIS}back",
    ),
    ("in_pockets", rf"{_WITH}{_HANDS} in {_HIS}(?:trouser |jacket |coat )?pockets?"),
)
"""(posture of the arms, pattern)."""
LYING: tuple[tuple[str, str], ...] = (
    (
        "stomach",
        r"(?:face|facing|belly|stomach) (?:down(?:wards)?|(?:to|on|against|towards) the (?:floor|ground|bed|mattress))|prone|prostrate|on (?:(?:the|his|her|their|its) )?(?:front|stomach|belly|tummy|face)",
    ),
    (
        "back",
        r"(?:face|facing|belly|stomach) (?:up(?:wards)?|(?:to|towards) the (?:ceiling|sky))|supine|on (?:(?:the|his|her|their|its) )?back",
    ),
    ("left_side", r"on (?:(?:the|his|her|their|its) )?left side"),
    ("right_side", r"on (?:(?:the|his|her|their|its) )?right side"),
    ("side", r"sideways|on (?:(?:one|a|the|his|her|their|its) )?side"),
)
"""(part of the body that somebody lies on, pattern); the words stay in the phrase of the action."""
TIRED = r"(?:and |very |quite |looking |who is |is )?(?:tired|exhausted|weary|fatigued|worn out|sleepy|drowsy)|tiredly|wearily|sleepily|with fatigue"
REPEATED = (
    r"(?:in|with) <a>(?:repetitive|repeated|repeating|periodic|cyclic|continuous) (?:manner|way|fashion|motion|movement|pattern)"
    r"|repeatedly|repetitively|periodically|again and again|over and over(?: again)?|several times|many times"
    r"|multiple times|a few times|continuously|constantly|without (?:end|pause|a pause|stopping|a break)|in a loop(?= ,|$)|repeat(?:ed|ing)?(?= ,|$)"
)
"""Words for repetition, a property of gestures, steps and jumps."""


def read_manner(reader: Reader, speed: Quantity = SPEED) -> None:
    """Take the words for the manner of an action, but for its way: `found` of the reader gets "pace" (factor), "speed"
    (range [m/s]), "amplitude" (factor), "rate" (range a minute), "pauses", "arm posture" and "tired".

    Raises:
        PromptError: a number is out of range.
    """
    reader.find("repeated", REPEATED, True, "repeated, as this action is")
    speed.read(reader)
    for pattern in RATES:
        for match in reader.take(pattern):
            RATE.note(reader, match, *_rate(match))
            if match.groupdict().get("kept"):  # "20 squats a minute"
                reader.restore(*match.span("kept"))
    reader.find("pauses", PAUSES, True, "with pauses")
    for posture, pattern in POSTURES:
        reader.find("arm posture", pattern, posture, f"arms: {posture.replace('_', ' ')}")
    for factor, pattern in PACES:
        reader.find("pace", pattern, factor, f"speed × {factor:g}")
    for factor, pattern in AMPLITUDES:
        reader.find("amplitude", pattern, factor, f"size × {factor:g}")
    reader.find("tired", TIRED, True, "tired")


def read_lying(phrase: str) -> str | None:
    """Part of the body that somebody lies on, of :data:`~rfgen_sionna.generative.manner.LYING`; None if no word gives
    it.

    Raises:
        PromptError: the words give several.
    """
    found = {place: match.group() for place, pattern in LYING if (match := re.search(rf"\b(?:{pattern})\b", phrase))}
    if len(found) > 1:
        raise PromptError(f"lying: the prompt names several: {', '.join(map(repr, found.values()))}")
    return next(iter(found), None)


def _rate(match: re.Match[str]) -> tuple[float, float]:
    """Repetitions a minute of a match of `RATES`."""
    groups = match.groupdict()
    if "seconds" in groups:
        low, high = {None: (1.0, 1.0), "other": (2.0, 2.0)}.get(groups["seconds"]) or limits(groups["seconds"])
        if low <= 0.0:
            raise PromptError(f"rate: {match.group()!r} is no time between repetitions; write one of more than 0 s")
        return 60.0 / high, 60.0 / low
    low, high = {"once": (1.0, 1.0), "twice": (2.0, 2.0)}.get(groups["value"]) or limits(groups["value"])
    scale = {"s": 60.0, "h": 60.0 if groups["per"][1] in "ez" and groups["per"] != "hour" else 1.0 / 60.0}
    factor = scale.get(groups["per"][0], 1.0)
    return low * factor, high * factor
