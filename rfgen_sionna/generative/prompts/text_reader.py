"""Phrases of plain text: normalisation, numbers, negations, patterns over inflected words.

Patterns are regular expressions with four abbreviations: `<verb>` for every inflection of a verb (`<swing|swung>` adds
irregular forms), `<a>` for an optional article or possessive with its space, `<n>` for a number in digits or words,
`<r>` for a number or a range ("2 to 4", "between 2 and 4").
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from typing import Any

from rfgen_sionna.generative.prompts.clauses import plain
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.vocabulary import ROOM

_NUMBER_WORDS = {
    "half": 0.5, "one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8,
    "nine": 9, "ten": 10, "eleven": 11, "twelve": 12, "fifteen": 15, "twenty": 20, "thirty": 30, "forty": 40,
    "fifty": 50, "sixty": 60, "seventy": 70, "eighty": 80, "ninety": 90,
}  # fmt: skip
_NUMBER = (
    r"(?:minus )?(?:\d{1,9}(?:\.\d+)?(?!\d)|half an?|(?:(?:twenty|thirty|forty|fifty|sixty|seventy|eighty|ninety) )?"
    rf"(?:one|two|three|four|five|six|seven|eight|nine)|{'|'.join(_NUMBER_WORDS)})(?: and an? half)?"
)
_TO = r"(?:up )?(?:to|until|till|through)"
_RANGE = (
    rf"(?:(?:anywhere |somewhere )?between {_NUMBER} and {_NUMBER}|(?:(?:anywhere |somewhere )?from )?{_NUMBER} {_TO} "
    rf"{_NUMBER}|{_NUMBER})"
)
_LIMITS = re.compile(rf"(?:[a-z ]*?(?:between|from) )?(?P<low>{_NUMBER})(?: (?:and|{_TO}) (?P<high>{_NUMBER}))?")
_UNIT_TWICE = (
    re.compile(rf"\b(between|from) ({_NUMBER}) ([a-z]+) (and|to|until|till|through) ({_NUMBER}) \3\b"),
    re.compile(rf"(?<![\w.])()({_NUMBER}) ([a-z]+) (to|until|till|through) ({_NUMBER}) \3\b"),
)
_ARTICLE = r"(?:(?:an?|the|one|either|his|her|their|its|my|your|some) )?"
_VERB = re.compile(r"(?<!P)<([a-z]{2,}(?:\|[a-z]+)*)>")
_EITHER = re.compile(
    r"(?:the )?left or (?:the )?right|(?:the )?right or (?:the )?left"
    r"|clockwise or (?:counter|anti)-?clockwise|(?:counter|anti)-?clockwise or clockwise"
)
_TAKEN = "~"
_VALUE_KEY = re.compile(
    r"""["']?\b(orientation|facing|distance|range|azimuth|bearing|height|weight|age|hand)\b["']?\s*[:=]\s*["']?"""
)
AFTERWARDS = re.compile(r"\b(?:then|afterwards|after|before \w+ing|finally|followed by)\b")
"""Words for a sequence of actions, which no source can perform."""
_NEGATIVE_KEY = re.compile(r"""["']?\bnegative(?:[ _]prompt)?\b["']?\s*[:=]\s*""", re.IGNORECASE)
_ANY_KEY = re.compile(r"""["']?\b[a-z]+(?:[ _]prompt)?\b["']?\s*[:=]|[;\n}]""", re.IGNORECASE)
_EXPONENT = re.compile(r"(?<![\w.])(\d{1,9}(?:\.\d+)?)e([+-]?\d{1,2})(?!\d|\.\d)")
_PLAIN_KEY = re.compile(
    r"""["']?\b(?:action|activity|motion|movement|gesture|pose|posture|target|subject|person|gender|sex|body|build"""
    r"""|speed|pace)\b["']?\s*[:=]\s*"""
)

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
    r"|(?:without|not|no) (?:moving|(?:any )?(?:movement|motion)s?)|(?:does|do) not move"
    r"|(?:without|with no) (?:end|pauses?|a pause|stopping|breaks?|a break)"
    r"|(?:stopping|stops) (?:in between|between|now and|every|from time|occasionally"
    r"|sometimes|repeatedly|several|on the way|at times)"
    r"|(?:occasionally|sometimes|repeatedly|with (?:[a-z]+ )?) ?(?:stopping|stops)|stop and go"
    r"|(?:room|office|lab|laboratory|garage|corridor|street|field|study) used to (?!be\b|have\b|hold\b)[a-z]+"
    r"|(?:room|office|lab|laboratory|garage|street|number) no (?:, )?\d+|minus(?= <n>)"
)
"""Names and numbers with such words: a bus stop, a never-ending corridor, minus 30 degrees."""


def number(text: str) -> float:
    """Value of a number in digits or words: "2.5", "two and a half", "twenty five", "half a", "minus 30"."""
    words = [word for word in text.split() if word not in ("and", "a", "an")]
    sign = -1.0 if words[0] == "minus" else 1.0
    return sign * sum(_NUMBER_WORDS[w] if w in _NUMBER_WORDS else float(w) for w in words if w != "minus")


def limits(text: str) -> tuple[float, float]:
    """Bounds of a range, or twice a number: "2 to 4", "between 2 and 4", "2.5"."""
    match = _LIMITS.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is neither a number nor a range")
    low = number(match["low"])
    high = number(match["high"]) if match["high"] else low
    return min(low, high), max(low, high)


def _inflect(match: re.Match[str]) -> str:
    verb, *irregular = match.group(1).split("|")
    if verb.endswith("e"):
        form = verb[:-1] + r"(?:e|es|ed|ing)"
    elif verb.endswith("y") and verb[-2] not in "aeiou":
        form = verb[:-1] + r"(?:y|ies|ied|ying)"
    else:
        form = verb + rf"(?:e?s|{verb[-1]}?ed|{verb[-1]}?ing)?"
    return "(?:" + "|".join([form, *irregular]) + ")"


@cache
def compile_pattern(pattern: str) -> re.Pattern[str]:
    """Compile a pattern with the abbreviations of this module; it matches whole words only."""
    pattern = pattern.replace("<a>", _ARTICLE).replace("<n>", _NUMBER).replace("<r>", _RANGE)
    pattern = _VERB.sub(_inflect, pattern)
    return re.compile(rf"(?<![\w.])(?:{pattern})(?!\w)")


def inflected(noun: str) -> str:
    """Pattern of a noun's singular and plural: "shelves", "chests of drawers"."""
    head, of, rest = noun.partition(" of ")
    if head.endswith("f"):
        head = f"{head.removesuffix('f')}(?:f|ve)"
    elif head.endswith("y") and head[-2] not in "aeiou":
        head = f"{head.removesuffix('y')}(?:y|ie)"
    return f"{head}(?:e?s)?{of}{rest}"


def _feet(match: re.Match[str]) -> str:
    return f"{int(match[1]) + int(match[2]) / 12:.3f} ft"


def _expand(match: re.Match[str]) -> str:
    digits = f"{float(match.group()):.9f}".rstrip("0")
    return digits.removesuffix(".")


def split_negative(text: str) -> tuple[str, str]:
    """Prompt without "negative: left arm, facing away", and these words.

    They end at the next keyword, the next ";", the end of the line or of the text.
    """
    unwanted = []
    while match := _NEGATIVE_KEY.search(text):
        following = _ANY_KEY.search(text, match.end())
        end = following.start() if following else len(text)
        unwanted.append(text[match.end() : end].strip(" ,.\"'"))
        text = f"{text[: match.start()]} , {text[end:]}"
    return text, ", ".join(words for words in unwanted if words)


def without_request(text: str) -> str:
    """A prompt without "simulate", "radar data of" and the like."""
    rest = plain(text)
    if not rest:
        return text
    request = " ".join(text.lower().split()).partition(rest)[0].split()
    if set(request) <= {"a", "an", "the", "some"}:
        return text
    return rest if rest.split()[0] in ("a", "an", "the") else f"a {rest}"


def normalise(text: str) -> str:
    """Text in lower case with "," as the only separator, spaces before units, no hyphens or apostrophes.

    Keywords begin a phrase: "action: push" becomes ", push", "distance: 2 m" becomes ", distance 2 m".
    """
    text = unicodedata.normalize("NFKC", text).lower()
    text = _PLAIN_KEY.sub(" , ", _VALUE_KEY.sub(r" , \1 ", text))
    text = text.replace("@", " at ")
    text = re.sub(r"(\d),(\d{1,2})(?!\d)", r"\1.\2", text)  # decimal comma
    text = _EXPONENT.sub(_expand, text)
    text = re.sub(r"(\d)\s*[-–—−]\s*(?=\d)", r"\1 to ", text)
    text = re.sub(r"(^|\s)[-−](?=\d)", r"\1minus ", text)
    text = re.sub(r"(?<![a-z])m/s", " mps ", text.replace("°", " degrees "))
    text = re.sub(r"\s*/\s*(min(?:ute)?|s(?:ec(?:ond)?)?|h(?:our)?)\b", r" per \1", text)
    text = _EITHER.sub("either", text)
    text = re.sub(r"n['’]t\b", " not", text)
    text = re.sub(r"['’]s\b", "", text)
    text = re.sub(r"\.(?!\d)|[,;:!?()\[\]\"“”\n/]", " , ", text)
    text = re.sub(r"[^\w., ]|_", " ", text)
    text = re.sub(r"(\d)([a-z])", r"\1 \2", text)
    text = re.sub(r"\b(\d{1,2}) (?:ft|feet|foot) (\d{1,2})(?: in(?:ch(?:es)?)?)?\b", _feet, text)
    text = " ".join(text.split())
    for twice in _UNIT_TWICE:  # "2 m to 4 m"
        text = " ".join(twice.sub(r"\1 \2 \4 \5 \3", text).split())
    return text


class Reader:
    """Text from which phrases are taken one after another; the rest is not understood."""

    def __init__(self, text: str) -> None:
        self.text = self.said = normalise(text)
        self.understood: list[tuple[str, str]] = []
        self.found: dict[str, list[tuple[str, Any]]] = {}
        """Name of a quantity -> (phrase, value)."""

    def find(self, name: str, pattern: str, value: Any, meaning: str) -> bool:
        """Take the phrases of a pattern as the `value` of a quantity; whether there are any."""
        matches = self.take(pattern, meaning)
        for match in matches:
            self.found.setdefault(name, []).append((match.group(), value))
        return bool(matches)

    def one(self, name: str) -> Any:
        """Value of a quantity; None without one.

        Raises:
            PromptError: there are several.
        """
        said = dict.fromkeys(self.found.get(name, []))
        if len({value for _, value in said}) > 1:
            raise PromptError(f"{name}: the prompt names several: {', '.join(repr(words) for words, _ in said)}")
        return next((value for _, value in said), None)

    def take(self, pattern: str, meaning: str | None = None) -> list[re.Match[str]]:
        """Take every match of `pattern`, so that later calls skip it.

        Args:
            pattern: pattern with the abbreviations of this module.
            meaning: meaning of the phrase for the report; None leaves it to :meth:`note`.
        """
        matches = list(compile_pattern(pattern).finditer(self.text))
        for match in matches:
            self.erase(match.start(), match.end())
            if meaning is not None:
                self.understood.append((match.group(), meaning))
        return matches

    def take_part(self, pattern: str, meaning: str) -> list[str]:
        """Take the group `part` of every match of a pattern."""
        matches = list(compile_pattern(pattern).finditer(self.text))
        for match in matches:
            self.erase(*match.span("part"))
            self.understood.append((match["part"], meaning))
        return [match["part"] for match in matches]

    def erase(self, start: int, end: int) -> None:
        """Take the characters from `start` to `end`, such as a group of a match."""
        self.text = self.text[:start] + _TAKEN * (end - start) + self.text[end:]

    def restore(self, start: int, end: int) -> None:
        """Give back the words from `start` to `end`."""
        self.text = f"{self.text[: start - 1]} {self.said[start:end]} {self.text[end + 1 :]}"

    def note(self, match: re.Match[str], meaning: str) -> None:
        """Record the meaning of a phrase for the report."""
        self.understood.append((match.group(), meaning))

    def rest(self, fillers: Iterable[str]) -> tuple[str, ...]:
        """Phrases that are not taken, split at `fillers`, words without meaning of their own."""
        fillers = frozenset(fillers)
        phrases: list[list[str]] = [[]]
        for word in self.text.replace(",", " , ").split():
            if word == "," or _TAKEN in word or word in fillers:
                phrases.append([])
            else:
                phrases[-1].append(word)
        return tuple(" ".join(phrase) for phrase in phrases if phrase)


def negation_in(text: str) -> str | None:
    """First negating word of a text, in lower case; None without one."""
    reader = Reader(text)
    reader.take(_NO_NEGATION)
    found = compile_pattern(_NEGATION).search(reader.text)
    return found.group().replace(" , ", "/") if found else None  # "w/o", as it was written
