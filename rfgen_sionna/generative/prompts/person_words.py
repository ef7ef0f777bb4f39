"""Words of a prompt about a person: who, where and how. The rest is the phrase of the action."""

# Tables of patterns read best with one phrase to a line.
# ruff: noqa: E501

from __future__ import annotations

import re
from dataclasses import dataclass, field

from rfgen_sionna.generative.prompts import vocabulary
from rfgen_sionna.generative.prompts.body_prompt import SIMPLE_NOUNS, BodyWords
from rfgen_sionna.generative.prompts.environment_prompt import read_scenes, refuse_unknown_place, split_keyword
from rfgen_sionna.generative.prompts.human_nouns import PERSON, PLURAL, is_human
from rfgen_sionna.generative.prompts.manner_prompt import PATHS, read_manner
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.quantities import (
    AGE,
    BREATHING,
    HEART,
    HEIGHT,
    ORIENTATION,
    WEIGHT,
    read_azimuth,
    read_last_length,
    read_lengths,
    refuse_misreadable,
)
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern, number, without_request

_BREATHS: tuple[tuple[float, str], ...] = (
    (0.0, r"(?:and |while |with )?(?:<hold|held|holding> <a>breath|<a>breath held)"),
    (15.0, r"(?:and |while )?<breathe>(?: (?:calmly|normally|quietly))?(?= ,| and|$)"),
)
"""(breaths a minute, pattern without a number)."""
_HANDS: tuple[tuple[str, str], ...] = (
    ("both", r"(?:with|using|by) (?:both|two) (?:of )?<a>(?:arms|hands|(?:index )?fingers)|both (?:hands|(?:index )?fingers)|with <a>hands"),
    ("left", r"(?:(?:with|using|by) )?<a>left (?:open )?(?:hand|arm|index finger|finger|forefinger|fist|palm)"),
    ("right", r"(?:(?:with|using|by) )?<a>right (?:open )?(?:hand|arm|index finger|finger|forefinger|fist|palm)"),
)  # fmt: skip
"""(hand, pattern); the words stay in the phrase of the action."""
_WITH_HAND = r"(?:with|using|by) (?:only )?<a>{hand} (?:open |flat )?(?:hands?|arms?|fists?|palms?)(?: only)?(?= ,| ~|$| (?:and|while|to|towards?|forwards?|in (?:a|the air))\b)"
"""Pattern of the hand that does it, which the action can do without."""
_SUBJECT = re.compile(
    r"^(?:[~, ]*)(?:there is )?(?:an?|the|this|that|another|my|his|her|our|your|some) (?P<how>(?:[a-z]+ ){0,3}?)"
    r"(?P<noun>[a-z]+)(?= (?:is|was|who|that|which|can|[a-z]+(?:s|ing|ed))\b)"
)
_NO_SUBJECT = frozenset(
    [
        "arm",
        "arms",
        "hand",
        "hands",
        "leg",
        "legs",
        "foot",
        "feet",
        "knee",
        "finger",
        "head",
        "body",
        "trunk",
        "pose",
        "gesture",
        "movement",
        "motion",
        "exercise",
        "jump",
        "fall",
        "walk",
        "wave",
        "kick",
        "punch",
        "swipe",
        "circle",
        "step",
        "steps",
        "push",
        "pull",
        "click",
        "bow",
        "squat",
        "run",
        "left",
        "right",
        "video",
        "recording",
        "picture",
    ]
)
_ARTICLES = frozenset(("a", "an", "the", "is", "are", "who", "that", "his", "her"))
_LINKS = frozenset(("and", "or", "is", "are", "who", "that", "which", "while"))
"""Words at the ends of a clause without meaning of their own."""
_PLAINER: tuple[tuple[str, str], ...] = (
    (r"(?:the )?either(?= (?:arm|hand|leg|foot|knee))", "one"),
    (r"(?:(?:to|from) )?(?:the )?either", ""),
    (
        r"<a>(?:left (?:(?:arm|hand) )?and (?:also )?<a>right|right (?:(?:arm|hand) )?and (?:also )?<a>left) (?:arm|hand)s?",
        "both arms",
    ),
    (rf"{vocabulary.GOES} (?:{dict(PATHS)['to_and_fro']})", "walks back and forth"),
    (rf"(?P<verb>{vocabulary.WALKS}) (?:{dict(PATHS)['to_and_fro']})", r"\g<verb> back and forth"),
    (r"(?<=[a-z] )with(?= (?:[a-z]+ ){0,3}?(?:arms?|hands?) (?!and\b)[a-z])", ","),
)
"""(pattern, other words); what the arms do meanwhile is a clause of its own."""
_REWORDED = (
    (re.compile(r"\bcross(?:es|ing|ed)? (?=(?:the|a) (?:[a-z]+ ){0,2}?(?:street|road|room|hall|corridor|field|office|lab|scene)\b)", re.IGNORECASE), "walks across "),
    (re.compile(r"\bup and down (?=(?:the|an?) (?!arms?|hands?|legs?|stairs|ladder|steps))", re.IGNORECASE), "back and forth along "),
)  # fmt: skip
"""(pattern, other words) of ways through places."""
_MEANWHILE = re.compile(r"\b(?:while|whilst|with|and)\b|,")
_OF_AN_ARM = re.compile(r"\b(?:arms?|hands?|fingers?|head|wav\w+|swing\w*|draw\w*|rotat\w+|nod\w*|shak\w+)\b")
_DECADES = ("twenties", "thirties", "forties", "fifties", "sixties", "seventies", "eighties")
_AGE = rf"in <a>(?:(?P<part>early|mid|late) )?(?:(?P<tens>[2-8])0 ?s|(?P<decade>{'|'.join(_DECADES)}))"
_TURN = (
    r"(?:turns?|turning|rotates?|rotating|spins?|spinning)(?: (?:around|round|by|through|about|left|right|to the left|to the right))* "
    r"(?P<angle><n>) degrees?(?: to the (?:left|right))?"
)
_COUNTED = (
    r"(?:for |after |within |up to )?(?:about |around |exactly )?(?:<n> (?:seconds?|secs?|minutes?|min|hours?|times|met(?:re|er)s?|cent(?:imeters?|imetres?)|steps|repetitions|reps|rounds)"
    r"|(?<![a-z])\d[\d.]*(?: (?:m|cm|km|s|kg|ft|feet|degrees?|percent|high|long|far|wide))*)"
)
"""Numbers without effect."""
_CONTENTS = (
    r"(?! [a-z ]*\b(?:arms?|hands?|legs?|foot|feet|knees?|fingers?|steps?|head)\b)"
    r"(?: (?!(?:at|in|on|and|while|facing|who|that|from|to|for)\b)[a-z]+){1,4}"
)
_SHAPES = rf"{vocabulary.WALKS}(?: [a-z~]+){{0,3}}? (?:in|along) (?:an? |the )?(?:square|rectangle|triangle|figure(?: of)? (?:eight|8)|eight|spiral|ellipse|oval|[lsu] shape)s?(?= ,| [a-z~]+ly| ~| at|$)"
"""Ways that nobody walks here."""
_CLOTHES = (
    r"(?:in|wearing|dressed in|wears) <a>(?:[a-z]+ ){0,2}?(?:coat|jacket|shirt|dress|suit|hat|hoodie|sweater|skirt|uniform|costume|outfit"
    r"|clothes|clothing|shoes|boots|slippers|high heels|jeans|trousers|pants|shorts|gown|helmet|cap|gloves|backpack)|barefoot"
)
_CIRCUMSTANCES = (
    r"in the (?:middle|center|centre|background|foreground|dark|rain|morning|afternoon|evening)(?: of the (?:room|scene|place|view))?|at (?:night|noon|home alone)"
    r"|in an? (?!controlled|sitting|standing|lying)[a-z]+ (?:manner|way|fashion|style|mood)"
    r"|happily|sadly|nervously|angrily|carefully|cautiously|elegantly|gracefully|confidently|casually|awkwardly|clumsily|loudly|suddenly|smoothly|normally|usually|today"
)
_TRAIT = r"(?:height|age|weight|gender|sex|body|build|size|stature)"
_BY_SEED = rf"(?:with|of) <a>random {_TRAIT}(?:(?: ,)?(?: and)? {_TRAIT})*|random(?= {PERSON})"
_HALF_TURN = 120.0
"""Least turn of the action `turn_around` [degrees]."""


def _plainly(clause: str) -> str:
    """A clause with fewer wordings of the same: for "either arm" one, for "up and down" back and forth."""
    for pattern, words in _PLAINER:
        clause = compile_pattern(pattern).sub(words, clause)
    return clause.strip()


@dataclass
class PersonWords:
    """Values in a text about a person, each with its words, in `reader.found` and here."""

    reader: Reader
    scenes: list[tuple[str, str]]
    """(words, surroundings)."""
    body: BodyWords = field(default_factory=BodyWords)
    targets: list[str] = field(default_factory=list)
    verbs: list[str] = field(default_factory=list)
    """Verbs of phrases that are read: "walks" of "approaches the radar"."""
    lost: list[str] = field(default_factory=list)
    """Words without effect."""

    def clauses(self) -> list[str]:
        """Clauses of the action: what no value has taken, without words that mean nothing alone."""
        found = []
        for clause in self.reader.text.split(","):
            words = clause.split()
            after = dict(zip(range(len(words)), [*words[1:], ""], strict=False))
            kept = [
                word
                for place, word in enumerate(words)
                if "~" not in word and not (word in _ARTICLES and "~" in after[place])
            ]
            while kept and kept[0] in _LINKS:
                del kept[0]
            while kept and kept[-1] in _LINKS:
                del kept[-1]
            if not set(kept) <= vocabulary.FILLERS:
                found.append(_plainly(" ".join(kept)))
        return [*self.verbs, *found]

    def read_hands(self) -> list[tuple[str, str]]:
        """(words, hand) of the phrase of the action."""
        text, found = self.reader.text, list(self.reader.found.get("hand", []))
        for hand, pattern in _HANDS:
            for match in compile_pattern(pattern).finditer(text):
                found.append((match.group(), hand))
                text = text[: match.start()] + "~" * len(match.group()) + text[match.end() :]
        return found

    def way(self) -> str | None:
        """Way over the floor in the words, one of :data:`~rfgen_sionna.generative.manner.PATHS`, and not of an arm."""
        said = self.reader.said
        for way, pattern in PATHS:
            for match in compile_pattern(pattern).finditer(said):
                if not _OF_AN_ARM.search(_MEANWHILE.split(self.reader.text[: match.start()])[-1]):
                    return way
        return None


def read_wanted(text: str) -> PersonWords:
    """Read a prompt.

    Raises:
        PromptError: several persons, a number out of range, a place behind the radar, an unknown place, or a subject
            that is neither a person nor known.
    """
    text = without_request(text)
    for pattern, words in _REWORDED:
        text = pattern.sub(words, text)
    text, scenes = split_keyword(text)
    said = PersonWords(Reader(text), scenes)
    reader = said.reader
    reader.understood += [(words, f"surroundings {scene}") for words, scene in scenes]
    refuse_misreadable(reader.text)
    reader.find("breathing", _BREATHS[0][1], (0.0, 0.0), "a held breath")
    for quantity in (BREATHING, HEART, HEIGHT, WEIGHT, AGE):
        quantity.read(reader)
    for match in reader.take(_AGE):
        first = 10.0 * (float(match["tens"]) if match["tens"] else 2.0 + _DECADES.index(match["decade"]))
        low, high = {"early": (0.0, 3.0), "mid": (4.0, 6.0), "late": (7.0, 9.0), None: (0.0, 9.0)}[match["part"]]
        AGE.note(reader, match, first + low, first + high)
    reader.find("breathing", _BREATHS[1][1], (15.0, 15.0), "15 breaths a minute")
    _read_common(said)
    reader.take(_BY_SEED, "drawn by the seed")
    _read_target(said)
    read_last_length(reader)
    said.lost += [match.group() for pattern in (_CLOTHES, _CIRCUMSTANCES) for match in reader.take(pattern)]
    refuse_unknown_place(reader)
    said.lost += [match.group() for match in reader.take(_COUNTED)]
    return said


def read_unwanted(text: str) -> PersonWords:
    """Read a negative prompt, of words and short phrases."""
    text, scenes = split_keyword(text)
    said = PersonWords(Reader(text), scenes)
    reader = said.reader
    reader.understood += [(words, f"surroundings {scene}") for words, scene in scenes]
    for trait, classes, nouns in SIMPLE_NOUNS:
        said.body.take_classes(reader, nouns, trait, classes)
    _read_common(said)
    for match in reader.take(PERSON):  # "a person" alone forbids everything
        said.targets.append(match.group())
    return said


def _read_common(said: PersonWords) -> None:
    reader = said.reader
    read_manner(reader)
    read_lengths(reader, height=True)
    read_azimuth(reader)
    reader.take(vocabulary.IN_VIEW, "within the radar's view, where everything is")
    both_ways = reader.take(vocabulary.BOTH_WAYS, "to and from the radar")
    if both_ways:
        said.verbs.append("walks back and forth")
    for hand in ("left", "right", "both"):
        reader.find("hand", rf"(?:(?<=, )|^)hand {hand}(?= ,|$)", hand, f"hand {hand}")
        reader.find("hand", _WITH_HAND.format(hand=hand), hand, f"{hand} hand{'s' if hand == 'both' else ''}")
    approach = reader.find("way", rf"<approach> {vocabulary.RADAR}", "to", "walks towards the radar")
    if approach or reader.take(rf"{vocabulary.GOES}(?= (?:{vocabulary.TO_RADAR}|{vocabulary.FROM_RADAR}))", "walks"):
        said.verbs.append("walks")
    for match in reader.take(_TURN):
        if number(match["angle"]) < _HALF_TURN:
            raise PromptError(
                f"action: {match.group()!r}: a turn of less than {_HALF_TURN:g}° is none that can be done; 'turns around' "
                "is, and 'turned 45 degrees' is an orientation"
            )
        said.verbs.append("turns around")
        reader.note(match, "turns around")
    for way, pattern in vocabulary.WALKING_WAYS:
        for words in reader.take_part(pattern, f"way: {way}"):
            reader.found.setdefault("way", []).append((words, way))
    if "way" in reader.found and reader.take(rf"{vocabulary.GOES}(?= ~)", "walks"):
        said.verbs.append("walks")
    ORIENTATION.read(reader)
    for angle, pattern in vocabulary.ORIENTATION_PATTERNS:
        reader.find("orientation", pattern, (angle, angle), f"orientation {angle:g}°")
    reader.find("way", vocabulary.FROM_RADAR, "away", "away from the radar")
    reader.find("way", vocabulary.TO_RADAR, "to", "towards the radar")
    before = len(said.scenes)
    shape = compile_pattern(_SHAPES).search(reader.text)
    if shape:
        raise PromptError(
            f"path: {shape.group()!r} is no way over the floor that is known; known are straight ahead, back and forth, in "
            "a circle, and a loop around the room"
        )
    said.scenes += read_scenes(reader)
    for words, _ in said.scenes[before:]:
        _lose_contents(said, words)
    reader.take(vocabulary.THE_ROOM, "in the surroundings")
    said.body.read_adjectives(reader)


def _lose_contents(said: PersonWords, scene: str) -> None:
    """Words about a place without effect: "in a [small] office [with two desks]"."""
    reader = said.reader
    match = re.search(rf"(?<![a-z]){re.escape(scene)}(?P<contents> with{_CONTENTS})?", reader.said)
    if match is None:
        return
    how = compile_pattern(rf"{vocabulary.HOW}(?: {vocabulary.HOW})*")
    for adjective in how.finditer(reader.text, match.start(), match.start() + len(scene)):
        said.lost.append(adjective.group())
        reader.erase(*adjective.span())
    if match["contents"]:
        said.lost.append(match["contents"].strip())
        reader.erase(match.start("contents") + 1, match.end())


def _read_target(said: PersonWords) -> None:
    """Take the person, and the words before it."""
    reader = said.reader
    for match in reader.take(rf"(?:<n> )?{PLURAL}"):
        raise PromptError(
            f"target: {match.group()!r} is more than one person; a prompt about one names one, and several are joined "
            "by 'and'"
        )
    first = compile_pattern(
        rf"(?:(?P<of>an?|the|this|that|one|some|my|his|her|our|your) (?P<how>(?:[a-z~]+ )*?))?(?P<who>{PERSON}(?: {PERSON})*)"
    ).search(reader.text)
    if first is None:
        subject = _SUBJECT.match(reader.text)
        if subject is None or subject["noun"] in _NO_SUBJECT or subject["noun"].endswith("ing"):
            return
        if not is_human(subject["noun"]):
            raise PromptError(
                f"target: {subject['noun']!r} is no person, animal or thing that is known; known are a person, by "
                "any noun, and the animals and things that rfgen things lists"
            )
        first = subject
    who = first.groupdict().get("who") or first["noun"]
    how = (first["how"] or "").split()
    if first.groupdict().get("of") and len([word for word in how if "~" not in word]) > 4:
        how, start = [], first.start("who")  # "a wave by a person"
    else:
        start = first.start()
    said.verbs += [word for word in how if word.endswith(("ing", "ed"))]
    said.lost += [
        word for word in how if "~" not in word and not word.endswith(("ing", "ed")) and word not in vocabulary.FILLERS
    ]
    reader.erase(start, first.end())
    said.targets.append(who)
    reader.understood.append((who, "target person" + said.body.read_noun(who)))
    for match in reader.take(rf"he|she|they|(?:(?<=^)|(?<=, ))(?:<a>{PERSON})(?= ,|$)"):
        said.targets.append(match.group())
        reader.note(match, "target person" + said.body.read_noun(match.group()))
