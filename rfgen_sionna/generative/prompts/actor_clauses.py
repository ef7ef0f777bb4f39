"""Prompts about several actors, split into one clause for each: "a woman walks past a man who sits"."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

from rfgen_sionna.generative.prompts.environment_prompt import read_scenes
from rfgen_sionna.generative.prompts.human_nouns import PERSON, PLURAL
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern, normalise, number, split_negative
from rfgen_sionna.generative.things.thing_catalogue import THINGS

MOST = 6
"""Most actors of a prompt."""
RELATIONS = ("apart", "facing", "side by side", "past", "beside", "behind", "in front", "towards", "pushing",
             "parting")  # fmt: skip
"""Places of actors to each other."""
_SINGULAR = {"people": "person", "men": "man", "women": "woman", "children": "child", "gentlemen": "gentleman",
             "ladies": "lady", "puppies": "puppy", "kitties": "kitty", "ponies": "pony"}  # fmt: skip
_STOP = (
    r"(?:in|on|at|with|near|beside|and|or|of|by|from|to|past|towards?|next|while|under|over|into|through|like|as|for|"
    r"who|that|which|is|are|an?|the|his|her|their|its|another|other)"
)
_DETERMINER = r"an?|the|another|one|his|her|their|its|our|your|my|some|this|that|each|both|<n>"
_UNIT = r"(?:years?|months?|yo|m|met(?:re|er)s?|cm|ft|feet|foot|kg|kilos?|lbs?|pounds?|degrees?|km|mps|times?|seconds?)"
_ONE = frozenset(
    {"both", "another", "the", "one", "his", "her", "their", "its", "our", "your", "my", "this", "that", "each"}
)
_PAIR = (
    ("facing", r"<shake> hands|<face> (?:each other|one another)|face to face"),
    ("facing", r"(?:<talk>|<speak>) (?:to|with) (?:each other|one another)"),
    ("parting", r"(?:away |apart )from (?:each other|one another)"),
    ("past", r"(?:towards?|past|by) (?:each other|one another)"),
    ("side by side", r"side by side|next to (?:each other|one another)|hand in hand|abreast|together"),
)  # fmt: skip
"""Relation of a group -> words of its common verb phrase."""
_LINKS = (
    ("past", r"past|around|by"),
    ("side by side", r"with|alongside(?: of)?|together with"),
    ("beside", r"next to|beside|besides|near|close to"),
    ("behind", r"behind|after"),
    ("in front", r"in front of|ahead of|before"),
    ("towards", r"towards?|up to|to|closer to"),
)
_FOLLOWS = re.compile(r"(?:is )?(?:follow(?:s|ing|ed)?|chas(?:es|ing|ed))$")
_FOLLOWED = re.compile(r"(?:, )?(?:is )?followed by$")
_PUSHES = re.compile(r"(?P<verb>(?:is )?push(?:es|ing|ed)?)$")
_LEADS = re.compile(r"(?P<verb>(?:is )?walk(?:s|ing|ed)?)$")
_ALIKE = (
    ("past", re.compile(r"(?:is |are )?(?:passing|passes|pass|meets?|meeting)$")),
    ("towards", re.compile(r"(?:is |are )?(?:approaching|approaches|approach)$")),
)
_CONJUNCTION = re.compile(r"\s*(?:,\s*)?\b(?:and|while|whilst|as|but|whereas|when)\b\s*$|\s*,\s*$")
_JOINED = re.compile(r"\s*(?:, ?and|and|,|plus|together with|along with|with|next to|beside)?\s*")
_FIXTURES = frozenset({"door", "curtain", "fan"})
"""Things that are often objects of a person's action."""
_BETWEEN = re.compile(
    rf"(?:\b(?:and|while|whilst|as|but|whereas|when|{'|'.join(words for _, words in _LINKS if words[0] != 't')})|,)\s*$"
)
_BREAK = r"(?:^|(?<= and )|(?<= while )|(?<= whilst )|(?<= but )|(?<= as )|(?<=, ))"
_PRONOUN = re.compile(
    rf"{_BREAK}(?:another|(?:the |an?)?other|(?:the |a )(?:first|second|third|fourth|fifth|sixth|last)|one)(?: one)?"
    rf"(?= (?!(?:{PLURAL})\b)(?:is|[a-z]{{2,}}s)\b)"
)
"""Actors that a pronoun stands for: "another stands up", "the second one sits"."""
_INTRODUCED = re.compile(rf"^(?:there are )?(?P<group>[^,]*\b(?:{PLURAL}))(?: (?:are|stand))? , (?=another person\b)")
_COLLECTIVE = re.compile(
    r"\b(?:an?|the) (?:group|crowd|team|family|pair) of (?=(?P<number>\d+|two|three|four|five|six))"
)
_FAMILY = re.compile(
    rf"\b(?:an?|the) (?:family|team) of (?P<number>\d+|two|three|four|five|six)"
    rf"(?= (?!(?:{PLURAL})\b)(?:is|are|[a-z]+s)\b)"
)
_AID = re.compile(r"\b(?:with|using|uses|on) (?:(?:an?|his|her|the|their) )?$")
_PLACE = re.compile(
    r"(?:,|(?:at|in|from) (?:an? )?(?:distance of |azimuth )?(?:minus )?[\d.]+(?: to [\d.]+)?(?: (?:m|degrees))?"
    r"(?: \w+ of boresight)?|(?:towards?|away from|facing) (?:the )?(?:radar|sensor)|\s)*"
)
"""Places after a noun, without a verb."""
_ALL = re.compile(r"(?:^| )(?:,? ?)(?:both|all)(?: of them)? (?P<said>[a-z]+ing\b.*)$")
_MOVING = re.compile(
    r"\b(?:walk|run|jog|sprint|stroll|march|step|go|move|limp|crawl|sneak|hurr|drive|roll|ride|fl(?:y|ies)|trot|gallop)\w*"
)
_RUNNING = re.compile(r"\b(?:run|jog|sprint|race|trot|gallop)\w*")
_OTHER = re.compile(r"^(?:who|that|which)\s+(?:is |are )?|^(?:is|are)\s+")


@dataclass(frozen=True)
class ActorClause:
    """Sentence of one actor."""

    text: str
    thing: str | None
    """Kind of a thing; None for a person."""


@dataclass(frozen=True)
class SeveralActors:
    """Clauses of a prompt, and the places of their actors to each other."""

    clauses: tuple[ActorClause, ...]
    relation: str
    """One of `RELATIONS`; "past", "behind" and the like are of the first actor to the second."""


@dataclass(frozen=True)
class _Noun:
    start: int
    end: int
    words: str
    count: int
    thing: str | None


def split_actors(prompt: str) -> SeveralActors | None:
    """Split a prompt about several actors; None for a prompt about one.

    Raises:
        PromptError: there are more than `MOST`, an uncounted crowd, or an interaction that cannot be carried out.
    """
    wanted, _ = split_negative(prompt)
    reader = Reader(_with_nouns(normalise(wanted).strip(" ,")))
    text = reader.said
    read_scenes(reader)
    nouns = _actors_of(reader.text)  # "in a car garage" is a place
    if (len(nouns) == 1 and nouns[0].count == 1) or not nouns:
        return None
    if sum(noun.count for noun in nouns) > MOST:
        raise PromptError(f"target: the prompt names {sum(n.count for n in nouns)} actors; at most {MOST} are possible")
    if len(nouns) == 1:
        return _counted(text, nouns[0])
    lead = text[: nouns[0].start].strip(" ,")
    common = _ALL.search(text, nouns[-1].end)
    if common:
        text = text[: common.start()]
    groups: list[list[_Noun]] = [[nouns[0]]]
    spans: list[str] = []
    for before, after in pairwise(nouns):
        gap = text[before.end : after.start]
        if gap.strip() and _JOINED.fullmatch(gap):
            groups[-1].append(after)
        else:
            spans.append(gap)
            groups.append([after])
    spans.append(text[nouns[-1].end :])
    if len(groups) == 1:
        said = f"{spans[0]} {common['said'] if common else ''}".strip()
        return _grouped(groups[0], f"{lead} , {said}" if lead else said)
    return _linked(groups, spans, lead, common["said"] if common else "")


def _with_nouns(text: str) -> str:
    """The text with nouns for pronouns and counts: "another stands" is "another person stands", "a group of three
    people" is "three people".

    Raises:
        PromptError: pronouns stand for other actors than the prompt has introduced.
    """
    text = re.sub(r"\bpass(?:es|ing)? (?=each other|one another)", "walk past ", text)
    text = _COLLECTIVE.sub("", _FAMILY.sub(r"\g<number> people", text))
    named, count = _PRONOUN.subn("another person", text)
    if not count:
        return text
    introduced = _INTRODUCED.match(named)
    if introduced:
        several = sum(noun.count for noun in _actors_of(introduced["group"]))
        if several != count:
            raise PromptError(
                f"target: the prompt names {several} actors and says what {count} do; write what each does"
            )
        return named[introduced.end() :]
    if any(match.group() == "one" for match in _PRONOUN.finditer(text)) and _actors_of(text):
        raise PromptError(
            f"target: {text!r} leaves open who 'one' is; name each, such as 'one person walks and another person sits'"
        )
    return named


@cache
def _noun_pattern() -> re.Pattern[str]:
    things = "|".join(f"(?P<{kind.name}>{re.sub(r'[?]P<[a-z0-9]+>', '?:', kind.nouns)})" for kind in THINGS.values())
    before = rf"(?P<count>{_DETERMINER}) (?:(?!{_STOP}\b|{_UNIT}\b)[a-z]+ ){{0,4}}?"
    return compile_pattern(rf"(?:{before})?(?:{things}|(?P<person>{PLURAL}|{PERSON}))")


def _actors_of(text: str) -> list[_Noun]:
    found: list[_Noun] = []
    for match in _noun_pattern().finditer(text):
        kind = next((name for name in THINGS if match[name]), None)
        noun = match[kind] if kind else match["person"]
        if found and not text[found[-1].end : match.start()].strip():  # "a male person"
            last = found.pop()
            found.append(
                replace(last, end=match.end(), words=f"{last.words} {match.group()}", thing=last.thing or kind)
            )
            continue
        if kind in _FIXTURES and found and not _BETWEEN.search(text[found[-1].end : match.start()]):
            continue  # "knocks at the door" is about a person
        if noun == "walker" and _AID.search(text[: match.start()]):
            continue  # "a woman with a walker" leans on it
        if noun in ("he", "she", "individual", "male", "female", "adult", "senior") and found:
            continue
        words, count = match["count"] or "", 1
        plural = noun in _SINGULAR or compile_pattern(PLURAL).fullmatch(noun) is not None
        if kind is not None:
            plural = noun.endswith("s") and not noun.endswith(("ss", "bus"))
        if words and compile_pattern("<n>").fullmatch(words):
            count = round(number(words))
        elif words == "both":
            count = 2
        elif noun == "couple":
            count, plural = 2, True
        elif plural and noun not in ("curtains",):
            raise PromptError(
                f"target: {match.group()!r} are several without a number; write how many, such as "
                f"'two {noun if noun.endswith('s') else 'people'}'"
            )
        if count == 1 and plural and noun in ("people", "men", "women", "children"):
            noun = _SINGULAR[noun]
        found.append(_Noun(match.start(), match.end(), match.group(), max(count, 1), kind))
    return found


def _singular(noun: _Noun) -> str:
    """Words of one of a group: "two tall men" is "a tall man"."""
    words = noun.words.split()
    if noun.count > 1 or words[0] in _ONE:
        words[0] = "a"
    last = words[-1]
    if noun.count > 1:
        words[-1] = "person" if last == "couple" else _SINGULAR.get(last, last.removesuffix("s"))
    return " ".join(words)


def _counted(text: str, noun: _Noun) -> SeveralActors:
    before, after = text[: noun.start].strip(" ,"), text[noun.end :].strip()
    return _grouped([noun], f"{after} , {before}" if before else after)


def _grouped(nouns: list[_Noun], said: str) -> SeveralActors:
    """Actors with a common verb phrase."""
    relation = "apart"
    said = said.strip()
    for name, pattern in _PAIR:
        if compile_pattern(pattern).search(said):
            relation = name
            break
    if relation in ("facing", "parting") and sum(noun.count for noun in nouns) != 2:
        raise PromptError(f"target: {said!r} is for two, the prompt names {sum(noun.count for noun in nouns)}")
    if "shak" not in said:
        for name, pattern in _PAIR:
            said = compile_pattern(pattern).sub("", said) if name == relation else said
    said = _OTHER.sub("", re.sub(r"\b(?:each other|one another)\b", "", " ".join(said.split())))
    verb = said if said.split(",")[0].strip() else f"stand {said}"
    clauses = [
        ActorClause(f"{_singular(noun)} {verb if noun.thing is None or said else said}".strip(), noun.thing)
        for noun in nouns
        for _ in range(noun.count)
    ]
    return SeveralActors(tuple(clauses), relation)


def _linked(groups: list[list[_Noun]], spans: list[str], lead: str, common: str) -> SeveralActors:
    """Actors with a verb phrase for each group, joined by conjunctions or by prepositions of place."""
    clauses: list[ActorClause] = []
    relation, verb = "apart", ""
    for index, (group, said) in enumerate(zip(groups, spans, strict=True)):
        said = _OTHER.sub("", said.strip())
        last = index == len(groups) - 1
        if last and relation in _COMMON and _PLACE.fullmatch(said):
            said = f"{_alike(verb, groups[0][0].thing, group[0].thing)} {said}".strip()
        if not last:
            rest = _CONJUNCTION.sub("", said)
            if rest == said:
                said, relation = _link(said, group[0], groups[index + 1][0])
                verb = said
            else:
                said = rest
        if _PLACE.fullmatch(said):
            said = f"{common or ('stands' if group[0].thing is None else '')} {said}".strip()
        for noun in group:
            text = f"{_singular(noun)} {said}".strip()
            clauses += [ActorClause(text, noun.thing)] * noun.count
    if relation == "apart" and len(clauses) == 2:
        for name, pattern in _LINKS:
            link = re.search(rf" (?:{pattern}) (?:him|her|them)$", clauses[1].text)
            if link:  # "a man sits and a woman walks past him"
                relation, clauses = name, [replace(clauses[1], text=clauses[1].text[: link.start()]), clauses[0]]
                break
    if relation != "apart" and len(clauses) != 2:
        raise PromptError(f"target: {relation!r} is a place for two actors, the prompt names {len(clauses)}")
    if lead:
        clauses = [ActorClause(f"{clause.text} , {lead}", clause.thing) for clause in clauses]
    return SeveralActors(tuple(clauses), relation)


_COMMON = ("side by side", "pushing", "behind", "in front")
"""Relations of which the second actor without a verb does as the first one."""
_MOVES = {"pram": "rolls", "wheelchair": "rolls", "car": "drives", "van": "drives", "bicycle": "rides",
          "drone": "flies", "bird": "flies", "robot_vacuum": "drives"}  # fmt: skip
"""Verbs of things that go along; animals walk or run."""
_RESTING = re.compile(r"\b(?:sit|stand|kneel|lie|lying|crouch)\w*")


def _alike(verb: str, first: str | None, thing: str | None) -> str:
    """Verb of an actor without one, who is beside, behind or before the `first` one: goes along with who goes."""
    if thing in _FIXTURES or thing == "corner_reflector":
        return ""
    if first in _FIXTURES or not _MOVING.search(verb):
        rests = _RESTING.search(verb) if first is None and thing is None else None
        return rests.group() if rests else "stands" if thing is None else ""
    if thing in _MOVES:
        return _MOVES[thing]
    if thing is None and first is None:
        return verb
    return "runs" if _RUNNING.search(verb) and first not in _MOVES else "walks"


def _link(said: str, one: _Noun, other: _Noun) -> tuple[str, str]:
    """Verb phrase before another actor without its link, and the relation to that actor."""
    if _FOLLOWED.search(said):
        return _FOLLOWED.sub("", said) or "walks", "in front"
    for name, pattern in _LINKS:
        match = re.search(rf"\b(?:{pattern})$", said)
        if match:
            verb = said[: match.start()].strip()
            if verb in ("is", "are"):
                verb = ""
            return verb, name
    goes = _MOVES.get(one.thing or "", "walks")
    if _FOLLOWS.search(said):
        return _FOLLOWS.sub("runs" if "chas" in said and goes == "walks" else goes, said), "behind"
    for name, alike in _ALIKE:
        if alike.search(said):
            return alike.sub(goes, said), name
    if _PUSHES.search(said) and other.thing in ("pram", "wheelchair"):
        return _PUSHES.sub("walks", said), "pushing"
    if _LEADS.search(said) and other.thing is not None:
        return said, "side by side"
    raise PromptError(
        f"action: {said!r} with {other.words!r} is no interaction of two actors that is known; known: shake hands, "
        "walk past, towards, beside, behind or in front of each other, side by side, push a pram or a wheelchair; or "
        "join two sentences with 'and'"
    )
