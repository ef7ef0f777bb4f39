"""Nouns for people: traits of the commonest, and a sentence encoder's judgement of all others."""

# Tables of words.
# ruff: noqa: ISC004

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.prompts.caption_encoder import CaptionEncoder

ADULT = frozenset({"young adult", "middle-aged", "elderly"})
_MALE, _FEMALE = frozenset({"male"}), frozenset({"female"})
_CHILD, _OLD = frozenset({"child"}), frozenset({"elderly"})
_YOUTH = frozenset({"child", "teenager"})

NOUN_TRAITS: tuple[tuple[str, frozenset[str], str], ...] = (
    ("gender", _MALE,
     r"man|gentleman|guy|bloke|chap|dude|fellow|lad|boy|he|male|father|dad|daddy|papa|grandfather|grandpa|granddad"
     r"|grandad|son|grandson|brother|uncle|nephew|husband|boyfriend|groom|widower|waiter|actor|king|prince|monk|priest"
     r"|policeman|fireman|mailman|postman|workman|businessman|salesman|craftsman|handyman|schoolboy|cowboy|sportsman"
     r"|cameraman|watchman|serviceman|stuntman"),
    ("gender", _FEMALE,
     r"woman|lady|girl|she|female|mother|mum|mummy|mom|mommy|mama|grandmother|grandma|granny|nan|nana|daughter"
     r"|granddaughter|sister|aunt|auntie|niece|wife|girlfriend|bride|widow|waitress|actress|queen|princess|nun"
     r"|ballerina|policewoman|businesswoman|saleswoman|housewife|schoolgirl|sportswoman|hostess|stewardess|midwife"),
    ("age", ADULT,
     r"man|gentleman|guy|bloke|chap|fellow|woman|lady|adult|grown ?up|father|dad|mother|mum|mom|husband|wife|waiter"
     r"|waitress|doctor|nurse|driver|worker|officer|soldier|teacher|policeman|policewoman|fireman|firefighter|mailman"
     r"|postman|workman|businessman|businesswoman|salesman|salesperson|janitor|cleaner|farmer|engineer|scientist"
     r"|researcher|pilot|chef|cook|clerk|guard|mechanic|plumber|carpenter|electrician|professor|lecturer|employee"
     r"|manager|boss|nun|monk|priest|operator|technician|surgeon|therapist|caregiver|carer|nanny"),
    ("age", _YOUTH, r"boy|girl|pupil|schoolboy|schoolgirl|schoolchild|youngster"),
    ("age", _CHILD, r"child|kid|toddler|baby|infant|preschooler|kindergartner|little one"),
    ("age", frozenset({"teenager"}), r"teen|teenager|adolescent|youth"),
    ("age", frozenset({"young adult"}), r"undergraduate"),
    ("age", _OLD,
     r"senior|elder|pensioner|retiree|grandfather|grandpa|granddad|grandad|grandmother|grandma|granny|nan|nana"
     r"|grandparent|senior citizen|old timer"),
)  # fmt: skip
"""(trait, classes, nouns)."""
_OTHERS = (
    r"person|human(?: being)?|someone|somebody|individual|subject|pedestrian|patient|resident|participant|volunteer"
    r"|user|visitor|guest|passenger|customer|client|student|player|athlete|dancer|boxer|fighter|gymnast|acrobat"
    r"|target|test person|test subject"
    r"|runner|jogger|walker|hiker|climber|swimmer|skater|wrestler|footballer|goalkeeper|sprinter|trainer"
    r"|burglar|thief|intruder|prisoner|victim|hero|clown|juggler|diver|mime|ninja|yogi|zombie|wizard|neighbou?r|friend|colleague"
    r"|roommate|housemate|stranger|bystander|commuter|shopper|tourist|traveller|traveler|speaker|singer|musician"
    r"|artist|performer|actor|model|citizen|owner|tenant|inhabitant|occupant|cousin|sibling|relative|parent"
    r""
)
"""Nouns without traits."""
PERSON = rf"(?:{'|'.join(dict.fromkeys('|'.join((*(nouns for *_, nouns in NOUN_TRAITS), _OTHERS)).split('|')))})"
"""Pattern of one person."""
PLURAL = (
    r"(?:persons|people|humans|individuals|subjects|pedestrians|men|women|guys|lads|ladies|gentlemen|adults|children"
    r"|kids|boys|girls|toddlers|babies|teen(?:ager)?s|seniors|elders|pensioners|patients|residents|participants"
    r"|volunteers|users|visitors|guests|passengers|customers|students|pupils|players|athletes|dancers|boxers|nurses"
    r"|doctors|workers|soldiers|friends|colleagues|neighbou?rs|strangers|twins|brothers|sisters|parents|couple|crowd"
    r"|runners|joggers|sprinters|walkers|hikers|group|family|team)"
)
"""Pattern of several people."""
_HUMAN = (
    "man woman worker nurse child athlete soldier grandmother farmer officer student musician visitor thief king "
    "customer teenager engineer dancer neighbour baker merchant priest criminal comedian lawyer hero gardener artist "
    "acrobat"
)
_OTHER = (
    "dog elephant robot machine computer bus chair tree bottle stone cloud house fish insect helicopter lamp ladder "
    "ball shadow doll excavator statue monster bread leaf festival snow market company weather music idea government "
    "night building price army"
)
_NEAREST = 5
"""Nouns of each kind that count."""


@cache
def is_human(noun: str) -> bool:
    """Whether a noun means a person: it is nearer to such nouns than to animals and things, by the meaning of
    :class:`.caption_encoder.CaptionEncoder`.

    Raises:
        ImportError: the packages of the encoder are missing.
    """
    vector = _encoded((noun,))[0]
    human, other = (np.sort(_encoded(tuple(nouns.split())) @ vector)[-_NEAREST:].mean() for nouns in (_HUMAN, _OTHER))
    return bool(human > other)


@cache
def _encoded(nouns: tuple[str, ...]) -> NDArray[np.float32]:
    """Vectors (noun, width) of nouns with their articles."""
    return CaptionEncoder().embed([f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}" for noun in nouns])
