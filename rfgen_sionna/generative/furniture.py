"""Names of furniture in layouts of places, and of finishes of their surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from rfgen_sionna.generative.prompts.text_reader import Reader, inflected
from rfgen_sionna.generative.prompts.vocabulary import ROOM

OTHER_NAMES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "armchair": ("arm chair", "easy chair", "lounge chair", "recliner"),
        "basketball hoop": ("basketball basket", "basketball net", "basketball ring"),
        "bed": ("bedstead", "bunk bed", "double bed", "single bed"), "bench": ("park bench",),
        "bicycle": ("bike", "push bike"), "bin": ("waste basket", "waste bin", "waste paper basket", "wastebasket"),
        "blackboard": ("black board", "chalk board", "chalkboard"),
        "bookshelf": ("book case", "book shelf", "bookcase"), "bush": ("shrub",),
        "cabinet": ("lab cabinet", "laboratory cabinet"), "car": ("automobile", "motor car"),
        "ceiling lamp": ("ceiling light", "chandelier", "pendant lamp", "pendant light"), "chair": (),
        "chest of drawers": ("bedroom dresser", "drawers", "dresser"),
        "climbing frame": ("climber", "jungle gym", "monkey bar"), "clock": ("wall clock",),
        "coat rack": ("coat stand", "coatrack", "hall stand", "hat stand"),
        "coffee table": ("cocktail table", "tea table"), "cupboard": (),
        "desk": ("office desk", "office table", "school desk", "student desk", "writing desk", "writing table"),
        "door": ("doorway",), "dustbin": ("wheelie bin",), "fence": ("railing",), "filing cabinet": ("file cabinet",),
        "fire extinguisher": ("extinguisher",), "floor lamp": ("floor light", "standard lamp", "standing lamp"),
        "garage door": ("garage gate", "roller door"), "gas cylinder": ("gas bottle", "gas tank"),
        "goal": ("football goal", "goal post", "goalpost", "soccer goal"),
        "hay bale": ("bale of hay", "bale of straw", "hay stack", "haystack", "straw bale"), "hedge": ("hedgerow",),
        "house": ("building",), "ladder": ("step ladder", "stepladder"),
        "lamp post": ("lamppost", "street lamp", "street light", "streetlamp", "streetlight"),
        "litter bin": ("litter basket",), "locker": (),
        "nightstand": ("bedside cabinet", "bedside table", "night stand", "night table"),
        "notice board": ("bulletin board", "noticeboard", "pin board", "pinboard"),
        "office chair": ("desk chair", "swivel chair"), "path": ("footpath",), "picture": ("painting", "poster"),
        "plant": ("house plant", "houseplant", "pot plant", "potted plant"), "radiator": ("heater",),
        "rock": ("boulder",), "rug": ("carpet",), "sandpit": ("sand box", "sand pit", "sandbox"),
        "seesaw": ("see saw", "teeter totter"), "shed": ("barn", "hut"),
        "shelf": ("shelf unit", "shelving", "shelving unit"),
        "sideboard": ("credenza", "television stand", "tv cabinet", "tv stand"),
        "sink": ("basin", "wash basin", "washbasin"), "slide": ("playground slide",),
        "sofa": ("couch", "love seat", "loveseat", "settee", "sofa bed", "sofabed"),
        "spring rider": ("rocking horse", "spring horse", "spring rocker"), "stool": ("lab stool",),
        "strip light": ("fluorescent lamp", "fluorescent light", "fluorescent tube", "neon light"),
        "swing": ("swing set", "swingset"), "table": ("dining table", "dinner table", "kitchen table"),
        "television": ("telly", "television set", "tv", "tv screen", "tv set"),
        "tool wall": ("peg board", "pegboard"), "traffic sign": ("road sign", "stop sign", "street sign"), "tree": (),
        "tyres": ("tire", "tyre"), "wardrobe": ("armoire",), "whiteboard": ("dry erase board", "white board"),
        "window": (), "workbench": ("lab bench", "laboratory bench", "lab table", "work bench"),
    }
)  # fmt: skip
"""Kind of furniture, doors and windows included -> other names, singular, in British and American English."""
FURNITURE = (
    "armchair", "bed", "bench", "bookshelf", "cabinet", "chair", "chest of drawers", "coat rack", "coffee table",
    "cupboard", "desk", "filing cabinet", "locker", "nightstand", "office chair", "shelf", "sideboard", "sofa", "stool",
    "table", "wardrobe", "workbench",
)  # fmt: skip
_BINS = ("bin", "dustbin", "litter bin")
SEVERAL: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "closet": ("cupboard", "wardrobe"),
        "furniture": FURNITURE,
        "garbage can": _BINS,
        "lamp": ("ceiling lamp", "floor lamp"),
        "piece of furniture": FURNITURE,
        "rubbish bin": _BINS,
        "trash bin": _BINS,
        "trash can": _BINS,
    }
)  # fmt: skip
"""Names of several kinds."""
EMPTY = (
    r"(?<!half )(?<!non )(?<!not )(?<!semi )(?:(?:completely|entirely|totally|almost|nearly) )?"
    rf"(?:bare|empty|unfurnished)(?= (?:[a-z]+ )?{ROOM}| ?[,.;]|$)"
)
"""Pattern of an empty place: nothing in it but doors, windows and the like, without :data:`LOOSE`."""
LOOSE = (
    *(kind for kind in FURNITURE if kind != "bench"),
    *("bicycle", "bin", "car", "floor lamp", "gas cylinder", "ladder", "plant", "rug", "television", "tyres"),
)
"""Kinds that an empty place is without."""


@dataclass(frozen=True)
class Name:
    """Name of one or several kinds of furniture."""

    pattern: str
    """Pattern of singular and plural (:func:`~rfgen_sionna.generative.prompts.text_reader.compile_pattern`)."""
    kinds: tuple[str, ...]
    compound: bool
    """Whether it has several words, such as "office chair", which contains a place."""


@cache
def names() -> Sequence[Name]:
    """All names, longer ones first."""
    named = {name: (kind,) for kind, others in OTHER_NAMES.items() for name in (kind, *others)} | dict(SEVERAL)
    order = sorted(named, key=lambda name: (-name.count(" "), -len(name)))
    return tuple(Name(inflected(name), named[name], " " in name) for name in order)


def take_compounds(reader: Reader) -> tuple[str, ...]:
    """Take furniture with names of several words out of a text, before places are read; returns the words."""
    return tuple(match.group() for name in names() if name.compound for match in reader.take(name.pattern))


def _made_of(surface: str, words: str, *finishes: str) -> tuple[str, str, tuple[str, ...]]:
    """Pattern of "concrete walls", "walls of concrete", "walls made of bare concrete"; surface; finishes."""
    noun, how = f"(?:{surface}s?)", f"(?:(?:bare|exposed|painted|old|polished) )?(?:{words})"
    return rf"{how} {noun}|{noun} (?:(?:made )?of|in|covered (?:with|in)) {how}", surface, finishes


SURFACES = (
    _made_of("wall", "concrete", "bare concrete", "masonry"),
    _made_of("wall", "brick(?:work|s)?", "brickwork"),
    _made_of("wall", "masonry|stone|rendered", "masonry"),
    _made_of("wall", "plaster(?:ed|board)?|dry ?wall", "plaster"),
    _made_of("floor", "wood(?:en)?|hardwood|parquet|laminate|floor ?boards?", "floorboards"),
    _made_of("floor", "carpet(?:ed|s)?", "carpet"),
    _made_of("floor", "tiled?|tiles|ceramic", "tiles"),
    _made_of("floor", "lino(?:leum)?|vinyl", "linoleum"),
    _made_of("floor", "concrete", "bare concrete"),
    _made_of("ceiling", "concrete", "bare concrete"),
    _made_of("ceiling", "plaster(?:ed|board)?", "plaster"),
)
"""(pattern, surface, :data:`~rfgen_sionna.scene.furnished.finishes.FINISHES`) of walls, floors and ceilings."""
