"""Patterns of prompts about animals and things, beside those of :mod:`rfgen_sionna.generative.prompts.vocabulary`."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

RADAR = r"<a>(?:radar|sensor|camera|device|antenna)"
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
