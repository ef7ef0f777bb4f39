"""Kinds of an action that its motions do not show, as words: they are refused, as the action alone would be another."""

from __future__ import annotations

import re
from collections.abc import Iterable

from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.word_order import FAMILIES

_HIS = r"(?:(?:the|a|one|his|her|their|its) )?"
_SIDE = r"(?:(?:left|right) )?"
_OWN = r"(?:his|her|their)"
_OFF_A_CHAIR = r"cross legged|crossed legs|legs crossed|lotus (?:position|pose)|tailor fashion|(?:bar|high) stool"
_GROUND = r"(?:floor|ground|carpet|rug|mat|grass)"
_SMALL_PART = r"(?:arm|elbow|wrist|finger|neck|head)"
_SEATED = ("sit", "sit_down", "sit_and_stand", "stand_up", "sit_down_heavily")
_VARIANTS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (
        ("lie_down",),
        rf"face down(?:wards)?|belly down|prone|(?:on|onto) {_HIS}{_SIDE}(?:front|stomach|belly|tummy|face|side)",
        "who lies down comes to lie on the back; 'lies face down' and 'lies on the side' can be done",
    ),
    (
        _SEATED,
        rf"(?<!feet )(?<!flat )on {_HIS}(?:(?!on\b)[a-z]+ )?{_GROUND}|{_OFF_A_CHAIR}|on {_OWN} (?:heels|knees)",
        "who sits is made on a seat, both feet on the floor",
    ),
    (
        ("crawl",),
        rf"back(?!wards? and for| and for| to )(?:wards?)?|in reverse|sideways|on {_OWN} (?:back|side|belly|stomach)",
        "who crawls goes ahead on hands and knees or feet, face down",
    ),
    (
        ("get_up",),
        rf"(?:from|off|lying on) {_HIS}{_SIDE}(?:back|front|stomach|belly|side)",
        "which way up somebody lies before is not chosen",
    ),
    (("crouch", "kneel"), rf"on {_OWN} heels", "who crouches is on the feet, and who kneels on one knee"),
    (("kneel",), rf"(?:both|two) (?:(?:of )?{_OWN} )?knees", "who kneels is on one knee"),
    (("sidestep",), r"crab(?: walk\w*)?", "who steps sideways is upright"),
    (
        ("bend",),
        rf"<lean> (?:back|{_HIS}{_SIDE}{_SMALL_PART}s?)|backwards?|sideways|to {_HIS}{_SIDE}(?:side|left|right)",
        "who bends goes forward from the hips",
    ),
    (
        ("look_around",),
        rf"(?:up|down)(?:wards)?|at {_HIS}(?:ceiling|floor|ground|sky|stars|feet|shoes)",
        "who looks around turns the head from side to side",
    ),
    (
        ("left_arm_raised", "right_arm_raised", "both_arms_raised"),
        r"forwards?|to the front|straight ahead|backwards?|behind (?:him|her|them)",
        "raised arms go over the shoulders; arms held forward or horizontally can be done, too",
    ),
    (
        ("hop", "jump", "squat", "run", "run_on_spot", "skip", "jumping_jacks", "walk", "walk_straight"),
        r"on (?:only |just )?(?:one|a single|<his>(?: left| right)?|<his>|the left|the right) (?:leg|foot)|one legged",
        "it is done with both legs",
    ),
    (
        ("clap",),
        rf"(?:above|over|behind) {_HIS}(?:head|back)|overhead|with one hand",
        "who claps has both hands before the body",
    ),
    (("hop", "jump", "skip"), r"ropes?", "no rope is swung; 'hops' can be done"),
    (("push_up", "handstand"), r"(?:on|with) (?:just )?one (?:hand|arm)|one[- ](?:handed|armed)", "it takes both"),
    (
        ("wave", "clap", "point", "sweep", "push", "pull", "throw", "click", *FAMILIES["circle"], *FAMILIES["swipe"]),
        rf"(?:with|<shake>) {_HIS}{_SIDE}(?:legs?|foot|feet|toes?|head)",
        "it is done with the hands",
    ),
    (("left_leg_raised", "right_leg_raised"), r"(?:both|<his>) (?:legs|feet|knees)", "the other leg carries"),
    (
        ("left_leg_raised", "right_leg_raised"),
        rf"backwards?|behind|sideways|to {_HIS}{_SIDE}side",
        "the way of the raised leg is not chosen",
    ),
    (
        FAMILIES["kick"],
        r"kick(?:s|ing)? back(?:wards?)?|backwards|with (?:both|two|<his>) (?:legs|feet)",
        "who kicks does it with one foot, ahead or to a side",
    ),
    (
        ("standing",),
        r"st(?:ands?|anding|ood) (?:out(?! (?:in|on|at|there|here|of|front)\b)|up for|in for)",
        "it is no posture; 'stands still' can be done",
    ),
    (("lift",), rf"(?:lift|rais)(?:s|es|ing) {_HIS}(?:own )?head", "who lifts takes something up with both hands"),
    (("limp", "climb_stairs"), r"backwards?|in reverse", "it goes ahead"),
    (("walk", "walk_straight"), rf"on {_HIS}heels", "who walks does it on the whole foot"),
    (
        ("slip", "faint", "stumble"),
        rf"backwards?|<ahead>|sideways|face (?:down|up)(?:wards)?|on {_HIS}{_SIDE}(?:back|face|front|stomach|side)",
        "how somebody comes to lie then is not chosen; 'falls backwards' can be done",
    ),
)  # fmt: skip
"""(actions, pattern of the words, the kind that is made instead)."""
_WITHOUT_EFFECT: tuple[tuple[tuple[str, ...], str], ...] = (
    (("point", "reach"), rf"(?:up|down|back)(?:wards?)?|at {_HIS}(?:ceiling|floor|ground|sky)|behind (?:him|her|them)"),
)
"""(actions, pattern of the words that their motions leave open)."""
_LIMBS = (
    r"(?:three|four|five|six|seven|eight|ten|[3-9]) ?-?(?:armed|legged|handed|headed)|two ?-?headed"
    r"|(?:one|single) ?-?(?:armed|legged|handed) (?:man|woman|person|boy|girl|child|adult)"
    r"|with (?:three|four|five|six|seven|eight|ten|[3-9]) (?:arms|hands|legs|heads)|with two heads"
    r"|<his> (?:three|four|six|eight) (?:arms|hands|legs)|all (?:three|four|six|eight) (?:arms|hands|legs)"
)
"""Limbs of no simulated person."""
_PASSIVE = (
    r"(?:is|are|was|being|gets?|getting|got) (?:(?:suddenly|gently|hard) )?"
    r"(?:pushed|pulled|kicked|punched|hit|struck|thrown|lifted|carried|picked up|dropped|shoved)"
)
"""Movements that somebody else makes."""
_SHORT = {
    "<ahead>": r"(?<!stumbles )(?<!stumbling )forwards?",
    "<his>": r"(?:his|her|their|its)",
    "<lean>": r"(?:leans?|leaning|bends?|bending)",
    "<shake>": r"(?:waves?|waving|claps?|clapping)",
}


def refuse_passive(prompt: str) -> None:
    """Check that nothing is done to the person by somebody else.

    Raises:
        PromptError: it is; with the words.
    """
    passive = re.search(rf"\b{_PASSIVE}\b", prompt.lower())
    if passive:
        raise PromptError(
            f"action: {passive.group()!r} is done to the person by somebody else, which cannot be done; say what the "
            "person does, such as 'stumbles' or 'falls backwards'"
        )


def refuse_limbs(prompt: str) -> None:
    """Check that the person has two arms, two legs and a head.

    Raises:
        PromptError: the words give others.
    """
    found = re.search(rf"\b(?:{_full(_LIMBS)})\b", prompt.lower())
    if found:
        raise PromptError(f"action: {found.group()!r} cannot be done: a person has two arms, two legs and one head")


def words_without_effect(actions: Iterable[str], phrase: str) -> tuple[str, ...]:
    """Words of a phrase that the motions of its actions leave open."""
    return tuple(
        match.group()
        for names, pattern in _WITHOUT_EFFECT
        if set(names) & set(actions)
        for match in re.finditer(rf"\b(?:{_full(pattern)})\b", phrase)
    )


def refuse_unmade(actions: Iterable[str], phrase: str) -> None:
    """Check that the words of a phrase ask for no kind of its actions that their motions do not show.

    Raises:
        PromptError: they do; with the words and with the kind that can be done.
    """
    for action in actions:
        for names, pattern, made in _VARIANTS:
            if action not in names:
                continue
            found = re.search(rf"\b(?:{_full(pattern)})\b", phrase)
            if found:
                raise PromptError(f"action: {found.group()!r} with {action!r} cannot be done: {made}; leave it out")


def _full(pattern: str) -> str:
    """The pattern with its abbreviations written out."""
    for short, words in _SHORT.items():
        pattern = pattern.replace(short, words)
    return pattern
