"""Kinds of an action that its motions do not show, as words: they are refused, as the action alone would be another."""

from __future__ import annotations

import re
from collections.abc import Iterable

from rfgen_sionna.generative.prompts.prompt_error import PromptError

_HIS = r"(?:(?:the|a|one|his|her|their|its) )?"
_SEATED = ("sit", "sit_down", "sit_and_stand", "stand_up", "sit_down_heavily")
_VARIANTS: tuple[tuple[tuple[str, ...], str, str], ...] = (
    (
        ("lie_down",),
        rf"face (?:down|up)(?:wards)?|prone|supine|on {_HIS}(?:back|front|stomach|belly|face|(?:(?:left|right) )?side)",
        "which way up somebody comes to lie is not chosen; 'lies on the back' can be done",
    ),
    (
        _SEATED,
        rf"(?<!feet )(?<!flat )on {_HIS}(?:floor|ground|carpet|rug|mat|grass)|cross legged|crossed legs|legs crossed",
        "who sits is made on a seat, both feet on the floor",
    ),
    (("crawl",), r"backwards?|in reverse|on (?:his|her|their) (?:back|side)", "who crawls goes ahead, face down"),
    (
        ("bend",),
        rf"(?:<lean> back)|backwards?|sideways|to {_HIS}(?:(?:left|right) )?side|to {_HIS}(?:left|right)",
        "who bends goes forward",
    ),
    (("look_around",), r"(?:up|down)(?:wards)?", "who looks around turns the head from side to side"),
    (
        ("left_arm_raised", "right_arm_raised", "both_arms_raised"),
        r"forwards?|to the front|straight ahead",
        "raised arms go over the shoulders; arms held forward or horizontally can be done, too",
    ),
    (
        ("hop", "jump"),
        r"on (?:only |just )?(?:one|a single|<his>(?: left| right)?|<his>|the left|the right) (?:leg|foot)|one legged",
        "who hops or jumps takes both legs",
    ),
    (
        ("clap",),
        rf"(?:above|over|behind) {_HIS}(?:head|back)|overhead|with one hand",
        "who claps has both hands before the body",
    ),
    (("wave",), rf"(?:with )?{_HIS}(?:(?:left|right) )?(?:legs?|foot|feet|head)", "who waves does it with a hand"),
    (("left_leg_raised", "right_leg_raised"), r"(?:both|<his>) (?:legs|feet|knees)", "the other leg carries"),
    (
        ("slip",),
        rf"(?:backwards?|forwards?|sideways)|on {_HIS}(?:back|face|front|stomach|(?:left |right )?side)",
        "how somebody comes to lie after a slip is not chosen; 'falls backwards' can be done",
    ),
)  # fmt: skip
"""(actions, pattern of the words, the kind that is made instead)."""
_PASSIVE = (
    r"(?:is|are|was|being|gets?|getting|got) (?:(?:suddenly|gently|hard) )?"
    r"(?:pushed|pulled|kicked|punched|hit|struck|thrown|lifted|carried|picked up|dropped|shoved)"
)
"""Movements that somebody else makes."""
_SHORT = {"<his>": r"(?:his|her|their|its)", "<lean>": r"(?:leans?|leaning|bends?|bending)"}


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


def refuse_unmade(actions: Iterable[str], phrase: str) -> None:
    """Check that the words of a phrase ask for no kind of its actions that their motions do not show.

    Raises:
        PromptError: they do; with the words and with the kind that can be done.
    """
    for action in actions:
        for names, pattern, made in _VARIANTS:
            if action not in names:
                continue
            for short, words in _SHORT.items():
                pattern = pattern.replace(short, words)
            found = re.search(rf"\b(?:{pattern})\b", phrase)
            if found:
                raise PromptError(f"action: {found.group()!r} with {action!r} cannot be done: {made}; leave it out")
