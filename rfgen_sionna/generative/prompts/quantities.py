"""Numbers of prompts with their units: places, angles, speeds, sizes. A range is drawn from by the seed."""

# A table of patterns reads best with one phrase to a line.
# ruff: noqa: E501

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from rfgen_sionna.generative.decisions import PROMPT, drawn
from rfgen_sionna.generative.prompts.human_nouns import PERSON
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.text_reader import Reader, compile_pattern, limits
from rfgen_sionna.generative.prompts.vocabulary import RADAR

_ABOUT = r"(?:(?:about|around|roughly|approximately|some|ca|nearly|almost) )?"
_METRES = r"(?:m|met(?:re|er)s?|cm|centimet(?:re|er)s?|mm|millimet(?:re|er)s?|feet|foot|ft|inch(?:es)?|yards?)"
_LENGTH = rf"{_ABOUT}(?P<value><r>) (?P<unit>{_METRES})"
_BORESIGHT = r"(?:<a>(?:radar )?(?:boresight|cent(?:re|er) ?line|(?:optical )?axis)|straight ahead)"
_SIDE_OF = rf"(?: (?:(?:to|on|towards) (?:the |its )?)?(?P<side>left|right)(?: of (?:{_BORESIGHT}|{RADAR}))?)"
_RANDOM = r"(?:random(?:ly chosen)?|arbitrary|any|varying|various|unknown)"
_SPEED_UNIT = (
    r"(?:mps|m s|m per s(?:ec(?:ond)?)?|met(?:re|er)s? (?:per|a|each) sec(?:ond)?|kmh|kph|km (?:per|an) h(?:our)?|kilomet(?:re|er)s? (?:per|an) hour"
    r"|mph|miles (?:per|an) hour|cm per s(?:econd)?|centimet(?:re|er)s? (?:per|a) second|(?:ft|feet) per s(?:econd)?)"
)
_SIZE = MappingProxyType({"mm": 0.001, "mi": 0.001, "m": 1.0, "c": 0.01, "f": 0.3048, "i": 0.0254, "y": 0.9144})
"""Beginning of a unit of length -> metres; the first that fits."""


@dataclass(frozen=True)
class Quantity:
    """A number of prompts."""

    name: str
    unit: str
    """Of values and messages."""
    allowed: tuple[float, float]
    patterns: tuple[str, ...]
    """Groups: `value` (or `value2`), `unit`, and `side`, of which "right" is negative."""
    factors: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Beginning of a unit in words -> factor to `unit`."""
    digits: int = 3
    """Decimal places."""
    unspecific: str = ""
    """Pattern of a random value without a range: "at a random distance"."""
    usual: tuple[float, float] = (0.0, 0.0)
    """Range of such a value."""
    hint: str = ""
    """Added to the message on a value that is not allowed."""

    def span(self, low: float, high: float) -> str:
        """Text of a range: "2 to 4 m"."""
        return f"{low:.6g}{self.unit}" if low == high else f"{low:.6g} to {high:.6g}{self.unit}"

    def read(self, reader: Reader) -> None:
        """Take the numbers of a text.

        Raises:
            PromptError: one is out of range.
        """
        for pattern in self.patterns:
            for match in reader.take(pattern):
                groups = match.groupdict()
                low, high = limits(groups.get("value") or groups["value2"])
                unit = groups.get("unit") or groups.get("unit2")
                scale = next((f for start, f in self.factors.items() if unit.startswith(start)), 1.0) if unit else 1.0
                if groups.get("side") == "right":
                    low, high = -high, -low
                self.note(reader, match, low * scale, high * scale)
        if self.unspecific:
            for match in reader.take(self.unspecific):
                self.note(reader, match, *self.usual)

    def note(self, reader: Reader, match: re.Match[str], low: float, high: float) -> None:
        """Record a value of a phrase; PromptError if it is out of range."""
        low, high = round(low, self.digits) + 0.0, round(high, self.digits) + 0.0
        for value in (low, high):
            if not self.allowed[0] <= value <= self.allowed[1]:
                least, most = self.allowed
                raise PromptError(
                    f"{self.name}: {match.group().replace('mps', 'm/s')!r} is {value:g}{self.unit}; allowed are {least:g}{self.unit} to "
                    f"{most:g}{self.unit}{self.hint}"
                )
        reader.found.setdefault(self.name, []).append((match.group(), (low, high)))
        reader.note(match, f"{self.name} {self.span(low, high)}")

    def draw(self, reader: Reader, seed: int, origins: dict[str, str]) -> float | None:
        """Value in the words of a reader, of a range by the seed; its origin goes into `origins`.

        Raises:
            PromptError: the words have several.
        """
        said = reader.found.get(self.name, [])
        wide = [(words, (low, high)) for words, (low, high) in said if low < high]
        if wide and all(wide[0][1][0] <= low <= high <= wide[0][1][1] for _, (low, high) in said):
            reader.found[self.name] = wide[:1]  # "random orientation range from 0-90 degrees, facing the radar"
        bounds = reader.one(self.name)
        if bounds is None:
            return None
        low, high = bounds
        if low == high:
            origins[self.name] = PROMPT
            return float(low)
        origins[self.name] = drawn(seed, [self.span(low, high)])
        stream = int.from_bytes(self.name.encode()[:4], "big")
        value = float(np.random.default_rng([seed, 12, stream]).uniform(low, high))
        return float(np.clip(round(value, min(self.digits, 2)), low, high))


DISTANCE = Quantity(
    "distance", " m", (0.05, 1000.0),
    (
        rf"(?:at |from |in )?<a>(?:{_RANDOM} )?(?:distance|range)s? (?:of |(?:that )?(?:varies|varying|drawn|chosen) |is )?{_LENGTH}(?: (?:away )?(?:from|to|of) {RADAR})?",
        rf"(?:at )?{_LENGTH} (?:away(?: from {RADAR})?|from {RADAR}|in front of {RADAR}|distant|distance|range|off)",
        rf"at {_LENGTH}(?! (?:tall|high|per|a second|above|over|off the))",
        r"distance (?P<value><r>)(?= ,|$)",
        rf"(?:starting )?from {_LENGTH}(?= ,| ~|$)",
    ),
    _SIZE, unspecific=rf"(?:at |from |in )?<a>{_RANDOM} (?:distance|range)s?(?: (?:from|to|of) {RADAR})?|distance {_RANDOM}(?= ,|$)", usual=(1.5, 5.0),
)  # fmt: skip
"""Distance from the radar over the floor [m]; a keyword without a unit ("distance: 2") is in metres."""
AZIMUTH = Quantity(
    "azimuth", "°", (-90.0, 90.0),
    (
        rf"(?:(?:at|in|with|under|from) )?<a>(?:{_RANDOM} )?(?:azimuth|bearing)(?: angle)?s?(?: of| range)?(?: of)? {_ABOUT}(?P<value><r>)(?: degrees?)?{_SIDE_OF}?",
        rf"(?:at )?<a>(?:angle of )?{_ABOUT}(?P<value><r>) degrees? (?:in |of )?azimuth{_SIDE_OF}?",
        rf"(?:at )?<a>(?:angle of )?{_ABOUT}(?P<value><r>) degrees? (?:off|from|away from) {_BORESIGHT}{_SIDE_OF}?",
        rf"(?:at )?{_ABOUT}(?P<value><r>) degrees? (?:(?:to|on) (?:the |its )?)?(?P<side>left|right) of (?:{_BORESIGHT}|{RADAR})",
    ),
    unspecific=rf"(?:at |from |in |with )?<a>{_RANDOM} (?:azimuth|bearing)(?: angle)?s?|azimuth {_RANDOM}(?= ,|$)", usual=(-60.0, 60.0), hint=", positive to the radar's left",
)  # fmt: skip
"""Azimuth of the person from the boresight, positive to the radar's left [degrees]."""
_TURNED = r"(?:<face>|<look>|turned|rotated|oriented|orientated|<rotate>|<turn>|orientation|heading)"
ORIENTATION = Quantity(
    "orientation", "°", (-180.0, 360.0),
    (
        rf"(?:with |at |in )?<a>(?:{_RANDOM} )?(?:(?:body|yaw|facing|rotation|heading) )?(?:orientation|yaw|rotation|heading|facing direction|direction)(?: angle)?s?(?: range[sd]?| varies| varying| drawn| chosen)?(?: (?:of|at|is|in|within))?(?: the range)?(?: (?:of|from))? {_ABOUT}(?P<value><r>)(?: degrees?)?(?: (?:to (?:the |<a>own )?)?(?P<side>left|right))?",
        rf"(?:(?:randomly )?{_TURNED} )?(?:(?:at|by|through|within) )?(?:<a>(?:{_RANDOM} )?(?:angles?|range) (?:of )?)?(?P<value><r>) degrees?(?: (?:to <a>(?:own )?)?(?P<side>left|right))?(?: (?:to|from) {RADAR}| orientation)?",
    ),
    unspecific=(
        rf"(?:(?:with|at|in|{_TURNED})(?: (?:to|in|at|into|towards?))? )?<a>{_RANDOM} (?:(?:facing|body|yaw) )?(?:orientation|direction|angle|rotation|yaw|heading|way)s?"
        rf"|orientation {_RANDOM}(?= ,|$)|(?:randomly (?:oriented|orientated|rotated|turned|facing)|(?:oriented|orientated|rotated|turned|facing) (?:at random|randomly|anywhere|any way))"
    ),
    usual=(0.0, 360.0), hint=" (0° to 360° or -180° to 180°)",
)  # fmt: skip
"""Rotation from facing the radar, positive to the person's own left [degrees]."""
SPEED = Quantity(
    "speed", " m/s", (0.05, 12.0),
    (rf"(?:(?:at|with|of) )?(?:<a>(?:{_RANDOM} )?(?:speed|velocity|pace) (?:of )?)?{_ABOUT}(?P<value><r>) (?P<unit>{_SPEED_UNIT})",),
    MappingProxyType({"mps": 1.0, "m ": 1.0, "me": 1.0, "km": 1.0 / 3.6, "kp": 1.0 / 3.6, "ki": 1.0 / 3.6, "mp": 0.44704,
                      "mi": 0.44704, "c": 0.01, "f": 0.3048}),
    digits=4,
)  # fmt: skip
"""Mean speed over the floor [m/s]."""
HEIGHT = Quantity(
    "height", " m", (0.9, 2.2),
    (
        rf"(?:with |of )?<a>(?:height|stature) (?:of )?{_LENGTH}(?: tall)?",
        rf"(?:who is )?{_LENGTH} (?:tall|in height)",
        rf"(?<=\ba ){_LENGTH}(?= (?:(?!(?:an?|the|distant|away|distance|range|wide|long|from)\b)[a-z]+ ){{0,2}}{PERSON})",
    ),
    _SIZE,
)  # fmt: skip
WEIGHT = Quantity(
    "weight", " kg", (12.0, 200.0),
    (rf"(?:who )?(?:(?:<weigh>|(?:with |of )?<a>weight|(?:with |of )?<a>mass)(?: of)? )?{_ABOUT}(?P<value><r>) (?P<unit>kg|kilos?|kilograms?|lbs?|pounds?)(?: heavy)?",),
    MappingProxyType({"k": 1.0, "l": 0.45359237, "p": 0.45359237}),
)  # fmt: skip
AGE = Quantity(
    "age", " years", (4.0, 90.0),
    (
        rf"(?:(?:aged|age|age of|ages|at the age of) ){_ABOUT}(?P<value><r>)(?: years?(?: old| of age)?)?",
        r"(?P<value><r>) (?:years? (?:old|of age)|yo|y ,? ?o)|(?:(?<=, )|^)(?P<value2><r>) years?(?= ,|$)",
    ),
    digits=0,
)  # fmt: skip
_EACH_MINUTE = r"(?:times|breaths?|beats?)? ?(?:a|per|each|every) (?:minute|min)"
_EACH_SECOND = r"(?P<unit>hz|hertz|(?:times|breaths?|beats?) ?(?:a|per|each|every) (?:second|sec))"
_PER_MINUTE = MappingProxyType(dict.fromkeys("htb", 60.0))
BREATHING = Quantity(
    "breathing", " a minute", (0.0, 90.0),
    (
        rf"(?:and |while |with )?(?:<breathe> |<a>(?:breathing|respiratory|respiration|breath) (?:rate |frequency )?)(?:at |of |with |is )?(?:<a>(?:rate|frequency) of )?{_ABOUT}(?P<value><r>) ?{_EACH_SECOND}",
        rf"(?:and |while |with )?(?:<breathe> |<a>(?:breathing|respiratory|respiration|breath) (?:rate )?)(?:at |of |with )?(?:<a>rate of )?{_ABOUT}(?P<value><r>) ?{_EACH_MINUTE}",
        rf"(?:and |with )?<a>(?:breathing|respiratory|respiration) rate (?:of |at |is )?{_ABOUT}(?P<value><r>)(?: bpm)?",
        rf"(?:and |with |at )?{_ABOUT}(?P<value><r>) (?:breaths?|respirations?) ?{_EACH_MINUTE}",
    ),
    _PER_MINUTE,
)  # fmt: skip
"""Breaths a minute."""
HEART = Quantity(
    "heart", " a minute", (0.0, 240.0),
    (
        rf"(?:and |with |while )?<a>(?:heart ?rate|pulse(?: rate)?|heart ?beat|heart)(?: (?:of|at|is|beats|beating))* {_ABOUT}(?P<value><r>) ?{_EACH_SECOND}",
        rf"(?:and |with |while )?<a>(?:heart ?rate|pulse(?: rate)?|heart ?beat|heart)(?: (?:of|at|is|beats|beating))* {_ABOUT}(?P<value><r>)(?: ?(?:bpm|{_EACH_MINUTE}))?",
        rf"(?:and |with |at )?{_ABOUT}(?P<value><r>) (?:heart ?)?beats ?{_EACH_MINUTE}",
    ),
    _PER_MINUTE,
)  # fmt: skip
"""Heartbeats a minute."""
ALTITUDE = Quantity(
    "height", " m", (0.01, 1000.0),
    (
        rf"(?:at )?<a>(?:height|altitude)(?: of)? {_LENGTH}",
        rf"(?:at )?{_LENGTH} (?:above|over|off|from) <a>(?:floor|ground)",
        rf"(?:at )?{_LENGTH} (?:(?:of )?(?:height|altitude)|high(?: up)?|up|in the air|above ground)(?: in the air)?",
    ),
    _SIZE,
)  # fmt: skip
"""Height of a thing over the floor [m]."""
RATE = Quantity("rate", " a minute", (1.0, 400.0), ())
"""Repetitions a minute; :mod:`.manner_prompt` has its patterns."""
VEHICLE_SPEED = replace(SPEED, allowed=(0.001, 100.0))
"""Speed of an animal or a thing [m/s]."""

_ASIDE = rf"(?:at )?(?:<a>angle of )?{_ABOUT}(?P<value><r>) degrees?(?: (?:(?:to|on) (?:the )?)?(?P<side>left|right)(?: side)?)?"
"""An angle whose words leave open whether it is an azimuth or an orientation."""
_BARE_LENGTH = (
    rf"(?:(?<=, )|^){_LENGTH}(?= ,|$)|(?:(?<=man )|(?<=male )|(?<=person )|(?<=adult )|(?<=~ ))(?:of )?"
    rf"{_LENGTH.replace('<value>', '<value2>').replace('<unit>', '<unit2>')}(?= (?:,|and|~)|$)"
)
_SEVERAL = (
    rf"<n> or <n> (?:{_METRES}|degrees?|kg|kilos?|lbs?|pounds?|years?)"
    rf"|<n> {_METRES}(?: (?:or|and))?(?: at)? <n> {_METRES}(?! (?:tall|high|in height))"
)
_UNREAD_DISTANCE = rf"(?:at|distance|range)(?: of)? (?:minus )?[\w.]*\d[\w.]*(?: [a-z]{{1,2}}\d*)? {_METRES}(?! (?:tall|high|per|a second))"
_LIMB_ANGLE = r"(?:arms?|hands?|legs?|knees?|elbows?|head|trunk|torso)(?: (?!fac|look|turn|rotat|orient|azimuth|with\b|and\b)[a-z]+){0,4} (?:by |at |to )?<r> degrees(?! (?:to )?(?:the )?(?:left|right) of (?:the )?boresight)"
_BEHIND = rf"(?:<n> {_METRES} )?behind {RADAR}"


def refuse_misreadable(text: str) -> None:
    """Raise a PromptError for several numbers of one value without a range, and for places behind the radar."""
    several = compile_pattern(_SEVERAL).search(text)
    if several:
        metres = compile_pattern(rf".* {_METRES}").fullmatch(several.group())
        raise PromptError(
            f"{'distance' if metres else 'numbers'}: the prompt names several: {several.group()!r}; give one number, or "
            'a range such as "2 to 3 m"'
        )
    limb = compile_pattern(_LIMB_ANGLE).search(text)
    if limb:
        raise PromptError(
            f"angle: {limb.group()!r} is the angle of a limb, which cannot be given; say raised or horizontal, or write "
            "the person's orientation between commas"
        )
    behind = compile_pattern(_BEHIND).search(text)
    if behind:
        raise PromptError(
            f"azimuth: {behind.group()!r} is out of the radar's view; a person stands in front of it, at an azimuth "
            "of -90° to 90°"
        )


def read_last_length(reader: Reader) -> None:
    """Take a length after words that are read, as the distance if there is none: "walking towards the radar 5 m"."""
    if DISTANCE.name not in reader.found:
        for match in reader.take(rf"(?<=~ ){_LENGTH}(?= ,| ~|$)"):
            low, high = limits(match["value"])
            DISTANCE.note(reader, match, low * _metres(match["unit"]), high * _metres(match["unit"]))


def _metres(unit: str) -> float:
    return next(factor for start, factor in _SIZE.items() if unit.startswith(start))


def read_azimuth(reader: Reader) -> None:
    """Take azimuths, also angles to a side that follow a distance: "at 3 m, 30 degrees to the left".

    Raises:
        PromptError: one is out of range.
    """
    AZIMUTH.read(reader)
    distances = tuple(words for words, _ in reader.found.get(DISTANCE.name, []))
    for match in compile_pattern(_ASIDE).finditer(reader.text):
        before = re.sub(r"(?: ,| and)* $", "", reader.said[: match.start()])
        if match["side"] and before.endswith(distances):
            low, high = limits(match["value"])
            AZIMUTH.note(reader, match, *((-high, -low) if match["side"] == "right" else (low, high)))
            reader.erase(*match.span())


def open_angles(reader: Reader) -> tuple[str, ...]:
    """Warnings of orientations whose words may also be a place: "45 degrees to the left"."""
    found = (compile_pattern(_ASIDE).fullmatch(words) for words, _ in reader.found.get(ORIENTATION.name, []))
    return tuple(
        f"prompt: {match.group()!r} is read as an orientation, and may be a place: write 'turned {angle} to the {side}', "
        f"or '{angle} {side} of boresight' for an azimuth"
        for match in found
        if match and (angle := f"{match['value']} degrees") and (side := match["side"] or "left")
    )


def read_lengths(reader: Reader, height: bool) -> None:
    """Take distances and lengths without a quantity ("1.8 m"), which are a height if they are written like heights of
    people, unless `height` is False.

    Raises:
        PromptError: a length may be both, or is no number.
    """
    DISTANCE.read(reader)
    for match in reader.take(_BARE_LENGTH):
        groups = match.groupdict()
        value, unit = (match["value"], match["unit"]) if groups["value"] else (match["value2"], match["unit2"])
        low, high = (_metres(unit) * bound for bound in limits(value))
        if height and 1.3 <= low <= high <= 2.3:
            if unit[0] == "c" or (unit[0] == "f" and "." in value):  # centimetres, feet and inches
                HEIGHT.note(reader, match, low, high)
                continue
            if {"weight", "age"} & reader.found.keys() and "height" not in reader.found:
                raise PromptError(
                    f"distance: {match.group()!r} may be a height or a distance; "
                    f'write "{low:g} m tall" or "{low:g} m away"'
                )
        DISTANCE.note(reader, match, low, high)
    unread = compile_pattern(_UNREAD_DISTANCE).search(reader.text)
    if unread:
        raise PromptError(f'distance: {unread.group()!r} is no number of metres; write it like "at 2.5 m"')
