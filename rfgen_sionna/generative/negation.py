"""Words that say what is not wanted. Prompts say what is; what is not has fields of its own, negative prompts."""

from __future__ import annotations

from rfgen_sionna.generative.text_reader import Reader, compile_pattern
from rfgen_sionna.generative.vocabulary import ROOM

_NEGATION = (
    r"not|never|no|nobody|none|nothing|cannot|without|neither|nor|minus|hardly|barely"
    r"|exclud(?:e|es|ed|ing)|except(?:s|ed|ing)?|avoid(?:s|ed|ing)?|stop(?:s|ped|ping)?|used to|instead|rather than"
    r"|other than|anything but|(?:<refuse>|<fail>|unable) to|<lack>|omit(?:s|ted|ting)?"
    rf"|free of|[a-z]{{3,}} free(?= (?:[a-z]+ )?{ROOM})"
    r"|devoid|sans|zero(?! degrees?)|missing|w , o|(?:all|everything) but"
)
_NO_NEGATION = (
    r"(?:bus|coach|door|full|pit|rest|school bus|taxi|train|tram|trolley|truck) stops?(?! [a-z]+ing)"
    r"|stop (?:buttons?|lamps?|lights?|lines?|signs?|watch(?:es)?)|non stop"
    r"|no (?:entry|frills|go|man land|parking|smoking|stopping|through|waiting)|never ending|forget me nots?"
    r"|(?:without|with no) end"
    r"|(?:room|office|lab|laboratory|garage|corridor|street|field|study) used to (?!be\b|have\b|hold\b)[a-z]+"
    r"|(?:room|office|lab|laboratory|garage|street|number) no (?:, )?\d+|minus(?= <n>)"
)
"""Names and numbers that such words are part of: a bus stop, a never-ending corridor, minus 30 degrees."""


def negation_in(text: str) -> str | None:
    """The first word of a text that negates something, in lower case; None where none does.

    Args:
        text: a sentence, keywords, or what :func:`~rfgen_sionna.generative.text_reader.normalise` has made of them.
    """
    reader = Reader(text)
    reader.take(_NO_NEGATION)
    found = compile_pattern(_NEGATION).search(reader.text)
    return found.group().replace(" , ", "/") if found else None  # "w/o", as it was written
