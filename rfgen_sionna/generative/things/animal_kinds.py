"""Animals by name: dog, cat, horse, bird."""

# Tables of patterns and sizes read best with one entry to a line.
# ruff: noqa: E501

from __future__ import annotations

import numpy as np

from rfgen_sionna.generative.things.animal_bodies import BIRD, CAT, DOG, HORSE
from rfgen_sionna.generative.things.animals import AnimalBody, animal
from rfgen_sionna.generative.things.articulated import ArticulatedSequence
from rfgen_sionna.generative.things.thing_kind import BuildRequest, ThingAction, ThingKind, ThingParameter

WALK = r"(?:<walk>|<stroll>|<pace>)"
STAND = r"(?:<stand|stood>(?! up)|<stay>|<wait>|<remain>)(?: (?:still|there|idle))*|still|idle|motionless|at rest"
_WING_BEATS = 3
"""Wing beats in the clip of flight."""
_GIRTH = ThingParameter("factor on the width of the body", (0.92, 1.08), (0.7, 1.4))


def _four_legged(body: AnimalBody, request: BuildRequest) -> ArticulatedSequence:
    return animal(body, request, size=request.values["height"], girth=request.values["girth"])


def _dog(request: BuildRequest) -> ArticulatedSequence:
    return _four_legged(DOG, request)


def _cat(request: BuildRequest) -> ArticulatedSequence:
    return _four_legged(CAT, request)


def _horse(request: BuildRequest) -> ArticulatedSequence:
    return _four_legged(HORSE, request)


def _bird(request: BuildRequest) -> ArticulatedSequence:
    rate = request.values["wing_beats_per_second"]
    return animal(
        BIRD, request, size=request.values["wing_span"], girth=request.values["girth"], wing_beats=(rate, _WING_BEATS)
    )


def _height(low: float, high: float, least: float, most: float) -> ThingParameter:
    return ThingParameter(
        "height at the shoulder [m]",
        (low, high),
        (least, most),
        r"(?P<value><n>) (?P<unit>m|met(?:re|er)s?|cm|centimet(?:re|er)s?) (?:tall|high|at the (?:shoulder|withers))",
    )


def _dog_actions(shoulder: float, own: dict[str, ThingAction]) -> dict[str, ThingAction]:
    """Actions on the dog's clips of an animal of a height at the shoulder [m]."""
    pace = float(np.sqrt(shoulder / DOG.size))
    return {
        "walk": ThingAction("walks", WALK, 0.57 * pace, 1.6 * pace),
        "run": ThingAction("runs", r"<run|ran>|<sprint>|<race>|<gallop>", 2.6 * pace, 9.0 * pace),
        "sneak": ThingAction("sneaks", r"<sneak|snuck>|<creep|crept>|<prowl>|<stalk>", 0.3 * pace, 0.6 * pace),
        "stand": ThingAction("stands", STAND),
        "crouch": ThingAction("stands with its head low, alert", r"(?:<stand|stood> |is )?alert|<crouch>|<lower> <a>head"),
        "sit": ThingAction("sits", r"<sit|sat|sitting>(?! (?:down|up))(?: still| there)?"),
        "sit_down": ThingAction("sits down", r"<sit|sat|sitting> down"),
        "stand_up": ThingAction("stands up from sitting", r"(?:<stand|stood>|<get|got>) up"),
        "jump": ThingAction("jumps on the spot", r"(?:<jump>|<leap|leapt>|<hop>)(?: (?:up and down|up|on the spot|high))*"),
        "bite": ThingAction("bites", r"<bite|bit|bitten>|<snap>"),
        "sniff": ThingAction("sniffs at the ground", r"<sniff>(?: at <a>(?:ground|floor)|around)?|<eat|ate>(?: from <a>(?:ground|floor|bowl))?"),
        "lie": ThingAction("lies on its side", r"<lie|lay|lying>(?! down)(?: (?:still|there|on <a>(?:side|floor|ground)))*"),
        "fall_over": ThingAction("falls over and lies", r"(?:<fall|fell|fallen>) (?:over|down)|<collapse>"),
        **own,
    }  # fmt: skip


KINDS = (
    ThingKind(
        "dog", "dog of medium size, with the gaits of an animated one", r"(?:dogs?|pupp(?:y|ies)|hounds?)",
        "0.45 to 0.62 m at the shoulder: from beagle to shepherd (breed standards of the FCI)",
        _dog_actions(0.5, {
            "bark": ThingAction("barks", r"<bark>|<yap>"),
            "howl": ThingAction("sits and howls", r"<howl>"),
        }),
        _dog, {"height": _height(0.45, 0.62, 0.15, 0.95), "girth": _GIRTH},
    ),
    ThingKind(
        "cat", "cat, with a dog's gaits in its own time", r"(?:cats?|kittens?|kitt(?:y|ies))",
        "0.23 to 0.27 m at the shoulder, typical of house cats", _dog_actions(0.25, {}),
        _cat, {"height": _height(0.23, 0.27, 0.12, 0.40), "girth": _GIRTH},
    ),
    ThingKind(
        "horse", "riding horse, with the gaits of an animated one", r"(?:horses?|pon(?:y|ies)|mares?|stallions?|foals?)",
        "1.48 to 1.70 m at the withers; ponies of the FEI are at most 1.48 m",
        {
            "walk": ThingAction("walks", WALK, 1.64, 2.2),
            "trot": ThingAction("trots", r"<trot>", 2.86, 5.0),
            "gallop": ThingAction("gallops", r"<gallop>|<canter>|<run|ran>|<race>", 5.79, 17.0),
            "stand": ThingAction("stands", STAND),
            "eat": ThingAction("eats from the ground", r"<eat|ate>(?: grass| hay)?|<graze>"),
            "rear": ThingAction("rears up", r"<rear>(?: up)?"),
            "kick": ThingAction("kicks with its hind legs", r"<kick>|<buck>"),
            "sleep": ThingAction("lies asleep", r"<sleep|slept>|asleep|<lie|lay|lying>(?: down| asleep)?"),
            "get_up": ThingAction("gets up from lying", r"(?:<get|got|getting>|<stand|stood>) up"),
            "fall_over": ThingAction("falls over and lies", r"(?:<fall|fell|fallen>) (?:over|down)|<collapse>"),
        },
        _horse, {"height": _height(1.48, 1.70, 0.8, 1.9), "girth": _GIRTH},
    ),
    ThingKind(
        "bird", "bird of the size of a crow", r"(?:birds?|crows?|ravens?|gulls?|seagulls?|pigeons?|doves?)",
        "wing span 0.84 to 1.0 m, of a carrion crow; 3 to 5 wing beats a second",
        {
            "fly": ThingAction("flies, flapping its wings", r"(?:<fly|flew|flown>|<flap>(?: <a>wings)?)", 8.0, 20.0, 2.0),
            "glide": ThingAction("glides", r"<glide>|<soar>", 10.0, 20.0, 3.0),
            "walk": ThingAction("walks", rf"{WALK}|<run|ran>|<hop>", 0.5, 1.5),
            "stand": ThingAction("stands", rf"{STAND}|<sit|sat|sitting>|<perch>"),
        },
        _bird,
        {
            "wing_span": ThingParameter("wing span [m]", (0.84, 1.0), (0.15, 2.5)),
            "wing_beats_per_second": ThingParameter("wing beats a second in flight", (3.5, 5.0), (1.0, 30.0), r"(?P<value><n>) (?:wing ?)?(?:beats|flaps|times) (?:a|per|each|every) second|(?P<value2><n>) ?hz"),
            "girth": _GIRTH,
        },
    ),
)  # fmt: skip
"""Animals."""
