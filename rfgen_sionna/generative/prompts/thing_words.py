"""Patterns of prompts about animals and things, beside those of :mod:`rfgen_sionna.generative.prompts.vocabulary`."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

RADAR = r"<a>(?:radar|sensor|camera|device|antenna)"
_ABOUT = r"(?:(?:about|around|roughly|approximately|some) )?"
SPEED = (
    rf"(?:(?:at|with|of) )?(?:<a>(?:speed|velocity|pace) of )?{_ABOUT}(?P<value><n>) (?P<unit>mps|m s|m per s(?:econd)?|"
    r"met(?:re|er)s? (?:per|a|each) second|km ,? ?h|kmh|kph|km per hour|kilomet(?:re|er)s? (?:per|an) hour|mph|miles (?:per|an) hour)"
)
PER_UNIT = {
    "mps": 1.0,
    "m ": 1.0,
    "me": 1.0,
    "km": 1.0 / 3.6,
    "kp": 1.0 / 3.6,
    "ki": 1.0 / 3.6,
    "mp": 0.44704,
    "mi": 0.44704,
}
"""Beginning of a unit of speed -> metres per second."""
_LENGTH = r"(?P<value><n>) (?P<unit>m|met(?:re|er)s?|cm|centimet(?:re|er)s?|feet|foot|ft)"
HEIGHTS = (
    rf"(?:at )?<a>(?:height|altitude)(?: of)? {_ABOUT}{_LENGTH}",
    rf"(?:at )?{_ABOUT}{_LENGTH} (?:above|over|off|from) <a>(?:floor|ground)",
    rf"(?:at )?{_ABOUT}{_LENGTH} (?:high(?: up)?|up|in the air|above ground)(?: in the air)?",
)
"""Height over the floor."""
STRAIGHT = r"(?:(?:straight|right|directly|slowly|quickly|fast|forwards?) )*"
MOVING_WAYS: tuple[tuple[str, str], ...] = (
    ("to", rf"<approach>(?: {RADAR})?|(?:<come|came>) (?:closer|nearer)(?: to {RADAR})?|<near> {RADAR}"),
    ("away", rf"<recede>(?: from {RADAR})?|<depart>|(?:<leave|left>)(?: {RADAR})"),
    ("past", rf"(?:<pass>|<cross>)(?: by)?(?: in front of)?(?: (?:{RADAR}|the (?:scene|view|room|street|road)))?"),
)
"""Verbs of a way, which also move."""
WAYS: tuple[tuple[str, str], ...] = (
    ("to", rf"{STRAIGHT}(?:towards?|up to|to|closer to) {RADAR}"),
    ("away", rf"{STRAIGHT}away(?: from {RADAR})?|from {RADAR} away"),
    ("right", r"from (?:the )?left to (?:the )?right|from the left"),
    ("left", r"from (?:the )?right to (?:the )?left|from the right"),
    ("right", r"(?:to )?(?:the )?right(?:wards?)?"),
    ("left", r"(?:to )?(?:the )?left(?:wards?)?"),
    ("past", rf"past(?: {RADAR})?|across(?: (?:{RADAR}|the (?:scene|view|room|street|road)))?|by(?= ,|$)"),
)
"""Ways as seen from the radar."""
MOVE = r"<move>|<go|went>|<come|came>|<travel>|<head>|in motion"
"""Verbs of any gait."""
OTHER_WAYS = (
    r"(?:in|around in|around) (?:a |the )?(?:circles?|loops?|squares?)|backwards?|back and forth|to and fro|forth and back|around|"
    r"<zigzag|zigzagging>|in zigzags?|<turn> (?:around|left|right)|upwards?|downwards?|<circle>|up and down"
)
"""Ways that only a path can give."""
NO_SUBJECT = (
    r"(?:in|on|at|with|near|beside|besides|behind|and|or|of|by|from|to|past|towards?|next|while|under|over|into|through|"
    r"like|as|for|against|before|after|a|an|the|his|her|their|is|are)"
)
"""Words that do not stand between an article and the subject."""
_LEAD = r"(?:[~,]+ ?)*(?:there (?:is|are|goes) |now )?"
SUBJECT = rf"{_LEAD}(?:(?P<count>an?|the|one|this|that|some|<n>) )?(?P<how>(?:(?!{NO_SUBJECT}\b)[a-z]+ ){{0,3}})"
"""Words before a subject."""
ATTRIBUTES = r"(?:male|female|adult|young|old|boy|girl|kid)"
"""Words of people that are also attributes of animals."""
