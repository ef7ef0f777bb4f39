"""Body of a prompt: gender, age, height, weight and muscle, by numbers or by classes of words.

The seed draws a value of a class ("tall", "elderly"); a negative prompt excludes classes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.generative.decisions import NEGATIVE, PROMPT, drawn
from rfgen_sionna.generative.prompts.human_nouns import ADULT, NOUN_TRAITS, PERSON
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern

TRAITS = ("gender", "age", "height", "weight", "muscle")


@dataclass(frozen=True)
class BodyPrompt:
    """Attributes of the body in a prompt; None leaves one open."""

    gender: str | None = None
    """"male" or "female"."""
    age_years: float | None = None
    height_m: float | None = None
    weight_kg: float | None = None
    muscle: float | None = None
    """0 (frail) to 1 (very muscular)."""
    drawn: frozenset[str] = frozenset()
    """Traits with a value drawn from a class of words ("heavy")."""

    def traits(self) -> dict[str, str | float | None]:
        """Trait -> value, in the order of :data:`TRAITS`."""
        values = (self.gender, self.age_years, self.height_m, self.weight_kg, self.muscle)
        return dict(zip(TRAITS, values, strict=True))


Range = tuple[float, float]

AGES: Mapping[str, Range] = {
    "child": (4.0, 12.0),
    "teenager": (13.0, 17.0),
    "young adult": (18.0, 35.0),
    "middle-aged": (36.0, 64.0),
    "elderly": (65.0, 80.0),
}
"""Class -> age [years]."""

HEIGHTS: Mapping[str | None, Mapping[str, Range]] = {
    "male": {"short": (1.60, 1.67), "average height": (1.70, 1.81), "tall": (1.84, 1.94)},
    "female": {"short": (1.48, 1.55), "average height": (1.58, 1.68), "tall": (1.71, 1.80)},
    None: {"short": (1.52, 1.60), "average height": (1.63, 1.75), "tall": (1.78, 1.88)},
}
"""Gender -> class -> stature of adults [m]: about the 2nd-10th, 20th-80th and 90th-99th percentile of ANSUR II (2012);
None is in between."""

BODY_MASS_INDICES: Mapping[str, Range] = {"slim": (17.5, 20.0), "average weight": (21.0, 25.0), "heavy": (29.0, 34.0)}
"""Class -> body mass index [kg/m^2], inside the WHO's bands of under/normal weight, normal weight and obesity."""

MUSCLES: Mapping[str, Range] = {"frail": (0.1, 0.3), "average build": (0.4, 0.6), "muscular": (0.75, 0.95)}
GENDERS = ("female", "male")

_Words = tuple[tuple[str, frozenset[str], str], ...]

SIMPLE_NOUNS: _Words = (
    ("gender", frozenset({"male"}), r"m[ae]n|gentlem[ae]n|guys?"),
    ("gender", frozenset({"female"}), r"wom[ae]n|lad(?:y|ies)"),
    ("age", frozenset({"child"}), r"child(?:ren)?|kids?"),
    ("age", frozenset({"teenager"}), r"teen(?:ager)?s?"),
    ("age", ADULT, r"adults?"),
    ("age", frozenset({"elderly"}), r"seniors?|elders?"),
)
"""(trait, classes, nouns) of a negative prompt: one trait each, "man" excludes men of any age."""

_PHRASES: _Words = (
    ("gender", frozenset({"male"}), r"male|masculine"),
    ("gender", frozenset({"female"}), r"female|feminine"),
    ("age", frozenset({"child"}), r"(?:small|little|tiny)(?= (?:child|kid|boy|girl|toddler|baby|infant)(?!\w))"),
    ("age", frozenset({"teenager"}), r"teenaged?"),
    ("age", frozenset({"young adult"}), r"young adult"),
    ("age", frozenset({"middle-aged"}), r"middle aged"),
    ("age", frozenset({"elderly"}), r"elderly"),
    ("height", frozenset({"average height"}), r"(?:of )?<a>(?:average|medium|normal) height"),
    ("weight", frozenset({"average weight"}), r"(?:of )?<a>(?:average|medium|normal) weight"),
    ("weight", frozenset({"heavy"}), r"heavy ?set|overweight|obese|chubby|stocky|corpulent"),
    ("weight", frozenset({"slim"}), r"slim|slender|skinny|underweight"),
    ("muscle", frozenset({"average build"}), r"(?:of )?<a>(?:average|medium|normal) build"),
    ("muscle", frozenset({"muscular"}), r"muscular|athletic|burly|well built|brawny"),
    ("muscle", frozenset({"frail"}), r"frail|unathletic|scrawny"),
)
"""Words that describe a body in any position."""

_ADJECTIVES: _Words = (
    ("age", frozenset({"elderly"}), r"old|senior"),
    ("age", frozenset({"child", "teenager", "young adult"}), r"young"),
    ("age", ADULT, r"adult"),
    ("height", frozenset({"short"}), rf"short|petite|(?:small|little)(?= (?:[a-z]+ ){{0,2}}?{PERSON}(?!\w))"),
    ("height", frozenset({"tall"}), r"tall"),
    ("weight", frozenset({"slim"}), r"thin|lean"),
    ("weight", frozenset({"heavy"}), r"heavy|fat|stout|plump"),
    ("muscle", frozenset({"frail"}), r"weak"),
    ("muscle", frozenset({"muscular"}), r"strong|fit|toned"),
)
"""Words that describe a body before a person, after "is" or alone between commas, unlike "short steps"."""


class BodyWords:
    """Classes of traits in a text."""

    def __init__(self) -> None:
        self.classes: dict[str, list[tuple[str, frozenset[str]]]] = {}
        self.values: dict[str, tuple[str, float]] = {}
        """Trait -> (phrase, number) of :mod:`.quantities`."""

    def read_adjectives(self, reader: Reader) -> None:
        """Take the adjectives, before their nouns are taken."""
        very = r"(?:(?:very|quite|rather|fairly) )?"
        for trait, classes, words in _PHRASES:
            self.take_classes(reader, rf"{very}(?:{words})(?= |$)", trait, classes)
        for trait, classes, words in _ADJECTIVES:
            word = rf"{very}(?:{words})"
            before_person = rf"{word}(?=(?:[ ,]+[a-z~]+){{0,5}}[ ,]+{PERSON}(?!\w))"
            place = rf"{before_person}|(?:(?<=is )|(?<=and )){word}|(?:(?<=, )|^){word}(?= ,|$)"
            self.take_classes(reader, place, trait, classes)

    def take_classes(self, reader: Reader, pattern: str, trait: str, classes: frozenset[str]) -> None:
        """Take the words of a pattern for classes of a trait."""
        for match in reader.take(pattern):
            self.classes.setdefault(trait, []).append((match.group(), classes))
            reader.note(match, f"{trait}: {' or '.join(sorted(classes))}")

    def read_noun(self, phrase: str) -> str:
        """Add the classes of the word for the target; returns them as text for the report."""
        said = []
        for trait, classes, nouns in NOUN_TRAITS:
            if compile_pattern(nouns).search(phrase):
                self.classes.setdefault(trait, []).append((phrase, classes))
                said.append(f", {trait}: {' or '.join(sorted(classes))}")
        return "".join(said)


def draw_body(wanted: BodyWords, unwanted: BodyWords, seed: int) -> tuple[BodyPrompt, dict[str, str]]:
    """Body within the classes and numbers of both prompts, and trait -> origin of its value.

    Args:
        wanted: words of the prompt.
        unwanted: words of the negative prompt.
        seed: seed of the draws, with an own stream for each trait.

    Raises:
        PromptError: the prompts contradict each other or themselves.
    """
    rng = {trait: np.random.default_rng([seed, i]) for i, trait in enumerate(TRAITS)}
    origins: dict[str, str] = {}
    drawn_traits: set[str] = set()

    def draw(trait: str, ranges: Mapping[str, Range], digits: int = 2) -> float | None:
        allowed = _allowed(trait, ranges, wanted, unwanted)
        if trait in wanted.values:
            return _stated(trait, ranges, wanted, unwanted)
        if allowed is None:
            return None
        widths = np.array([ranges[c][1] - ranges[c][0] for c in allowed])
        chosen = allowed[rng[trait].choice(len(allowed), p=widths / widths.sum())]
        value = round(float(rng[trait].uniform(*ranges[chosen])), digits)
        drawn_traits.add(trait)
        origins[trait] = drawn(seed, allowed)
        return value

    def words_about(trait: str) -> bool:
        return trait not in wanted.values and (trait in wanted.classes or trait in unwanted.classes)

    genders = _allowed("gender", GENDERS, wanted, unwanted)
    gender = None if genders is None else genders[int(rng["gender"].integers(len(genders)))]
    if genders is not None:
        said = PROMPT if "gender" in wanted.classes else NEGATIVE
        origins["gender"] = drawn(seed, genders) if len(genders) > 1 else said
    age = draw("age", AGES, 0)
    for trait, example in (("height", "1.3 m tall"), ("weight", "30 kg")):
        if age is not None and age < AGES["young adult"][0] and words_about(trait):
            raise PromptError(f'{trait}: words for it are known for adults only; give a number, such as "{example}"')
    height = draw("height", HEIGHTS[gender])
    if words_about("weight"):
        if height is None:
            # for the mass of a body mass index
            height = round(float(rng["height"].uniform(*HEIGHTS[gender]["average height"])), 2)
            origins["height"] = drawn(seed, ["average height"])
        index = draw("weight", BODY_MASS_INDICES)
        weight = None if index is None else round(index * height**2, 1)
    else:
        weight = draw("weight", BODY_MASS_INDICES) if "weight" in wanted.values else None
    muscle = draw("muscle", MUSCLES)
    return BodyPrompt(gender, age, height, weight, muscle, frozenset(drawn_traits)), origins


def _stated(trait: str, ranges: Mapping[str, Range], wanted: BodyWords, unwanted: BodyWords) -> float:
    """Number of a trait in the prompt; PromptError if it contradicts the words."""
    phrase, value = wanted.values[trait]
    if trait == "weight":  # classes are of the body mass index
        return value

    def within(classes: Iterable[str]) -> bool:
        # Ages are whole years, heights between two classes belong to neither, extremes to the outer classes.
        bounds = [bound for r in ranges.values() for bound in r]
        measure = min(max(math.floor(value) if trait == "age" else value, min(bounds)), max(bounds))
        return any(ranges[c][0] <= measure <= ranges[c][1] for c in classes)

    for word, classes in wanted.classes.get(trait, []):
        if trait == "age" and not within(classes):
            raise PromptError(f"{trait}: {phrase!r} and {word!r} contradict each other")
    for word, classes in unwanted.classes.get(trait, []):
        if within(classes):
            raise PromptError(f"{trait}: the prompt asks for {phrase!r}, the negative prompt forbids {word!r}")
    return value


def _allowed(trait: str, known: Iterable[str], wanted: BodyWords, unwanted: BodyWords) -> list[str] | None:
    """Classes of a trait that both prompts allow; None without words about it."""
    said, denied = wanted.classes.get(trait, []), unwanted.classes.get(trait, [])
    if not said and not denied:
        return None
    allowed = set(known)
    for _, classes in said:
        allowed &= classes
    if not allowed:
        raise PromptError(f"{trait}: the prompt contradicts itself: {', '.join(repr(word) for word, _ in said)}")
    for word, classes in denied:
        allowed -= classes
        if not allowed:
            rest = ", ".join(repr(w) for w, _ in said) or "nothing else"
            raise PromptError(f"{trait}: the negative prompt forbids {word!r}, which leaves nothing of {rest}")
    return [c for c in known if c in allowed]
