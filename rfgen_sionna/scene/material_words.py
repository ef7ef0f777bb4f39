"""Further words for materials: other spellings, which count, and words of everyday things, which are hints only."""

from __future__ import annotations

import re
from difflib import get_close_matches

from rfgen_sionna.scene.material_table import TABLE

_METALS = (
    "aluminium aluminum brass bronze car car_body chrome copper gold iron lead nickel silver stainless_steel steel tin "
    "titanium zinc"
)
_SPELLINGS = {
    "metal": _METALS, "vacuum": "air free_space", "pec": "perfect_conductor", "skin": "dry_skin human_skin",
    "clothing": "cloth cotton fabric linen polyester silk textile upholstery", "denim": "jeans", "wool": "felt fleece",
    "pmma": "acrylic acrylic_glass perspex plexiglas plexiglass", "polycarbonate": "lexan makrolon",
    "ptfe": "teflon", "polyethylene": "hdpe ldpe pe polythene", "nylon": "polyamide", "pom": "acetal delrin",
    "pet": "petg", "styrofoam": "eps expanded_polystyrene", "carbon_fibre": "carbon_fiber cfrp",
    "ceramic": "earthenware porcelain stoneware", "cardboard": "corrugated_board", "asphalt_concrete": "asphalt tarmac",
    "carpet_tile": "carpet", "vinyl_tile": "vinyl", "plasterboard": "drywall gypsum_board",
    "polypropylene": "pp", "polystyrene": "ps", "water": "fresh_water h2o liquid_water pure_water", "snow": "dry_snow",
    "sea_water": "ocean_water salt_water seawater", "wet_soil": "mud moist_soil",
}  # fmt: skip
ALIASES: dict[str, str] = {word: name for name, words in _SPELLINGS.items() for word in words.split()}
"""Other spellings of the names in :data:`~rfgen_sionna.scene.material_table.TABLE`."""

_MEANINGS = {
    "skin": "adult arm blood body child face finger flesh foot hand head human leg man meat muscle people person torso "
    "woman",
    "clothing": "clothes coat curtain dress garment jacket pullover shirt sofa sweater trousers",
    "metal": "appliance bicycle bike blade bumper can corner_reflector drone engine foil fridge hood mirror paint pipe "
    "rail reflector rim stainless truck vehicle",
    "glass": "pane screen windscreen windshield window",
    "water": "beverage drink fluid lake liquid milk pool puddle rain river sweat",
    "concrete": "building cement masonry mortar pavement stone wall",
    "marble": "granite rock slate",
    "wood": "bamboo bark desk door furniture log mdf oak parquet pine table timber",
    "plasterboard": "gypsum plaster",
    "soil": "clay dirt earth gravel ground loam sand",
    "vegetation": "bush foliage grass leaf leaves plant tree",
    "asphalt_concrete": "road street tar",
    "plastic": "bottle case casing epoxy fiberglass fibreglass housing polymer radome resin thermoplastic",
    "rubber": "shoe silicone sole tire tyre wheel",
    "foam": "cushion mattress pillow sponge",
    "ice": "frost hail",
    "ceramic": "alumina bathtub clinker sink tile toilet",
    "paper": "book newspaper",
    "cardboard": "carton parcel",
    "carbon_fibre": "carbon composite graphite",
    "ceiling_board": "ceiling",
    "floorboard": "floor laminate",
}
_HINTS = {word: name for name, words in _MEANINGS.items() for word in words.split()}


def canonical_name(name: str) -> str:
    """Name in :data:`~rfgen_sionna.scene.materials.MATERIALS` of an alias or a name with Sionna's prefixes; an unknown
    name in small letters."""
    key = name.strip().lower().replace(" ", "_").replace("-", "_")
    key = key.removeprefix("mat_").removeprefix("itu_").removeprefix("rfgen_")
    return ALIASES.get(key, key)


def suggested_material(name: str) -> str:
    """Known material that an unknown `name` means ("human", "Concrete_Wall.001", "concret"); empty without one."""
    words = [word for word in re.split(r"[^a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()) if word]
    phrases = ["_".join(words[i:j]) for i in range(len(words)) for j in range(len(words), i, -1)]
    for phrase in phrases:
        for form in (phrase, phrase.removesuffix("s")):
            if found := form if form in TABLE else ALIASES.get(form, _HINTS.get(form, "")):
                return found
    slip = "_".join(words)  # in spelling: "hair" is not "air", "bone" not "bronze"
    near = [word for word in (*TABLE, *ALIASES) if word[0] == slip[:1] and abs(len(word) - len(slip)) < 2]
    close = get_close_matches(slip, near, n=1, cutoff=0.8)
    return close[0] if close else ""
