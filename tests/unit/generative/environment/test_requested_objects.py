"""What words name: places and furniture by the words themselves, and what is excluded is in no sketch."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.environment_model import read_model
from rfgen_sionna.generative.environment.image_models import (
    AbsentThingWarning,
    EmbeddedImageModel,
    UnknownPlaceWarning,
    UnknownThingWarning,
    UnknownWordsWarning,
)
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.generative.environment.requested_objects import NAMES, check_words, is_empty, read_objects
from rfgen_sionna.generative.environment.room_selection import PlaceRequest, choose_room
from rfgen_sionna.generative.furniture import LOOSE, OTHER_NAMES, SEVERAL
from rfgen_sionna.generative.prompts.body_prompt import PromptError
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import furnished
from training.environment.pir_data import PLACES
from training.environment.place_captions import USUAL, article, caption

AHEAD = View((32, 32), (90.0, 90.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
NOUNS = sorted({noun for nouns in USUAL.values() for noun in nouns})
PLURALS = {
    "bookshelf": "bookshelves",
    "shelf": "shelves",
    "bench": "benches",
    "workbench": "workbenches",
    "bush": "bushes",
    "chest of drawers": "chests of drawers",
    "tyres": "tyres",
}
"""All others end in an s."""


@pytest.fixture(scope="module")
def text() -> PlaceEncoder:
    return read_model().text


def wanted(text: PlaceEncoder, prompt: str, negative: str = "") -> PlaceRequest:
    """As the model's drawings have it."""
    return PlaceRequest(text.place_of(prompt)[0], text.read(prompt).meant, text.read(negative).things)


@pytest.mark.parametrize("noun", NOUNS)
def test_a_noun_is_itself_alone(text: PlaceEncoder, noun: str) -> None:
    plural = PLURALS.get(noun, f"{noun}s")
    for words in (noun, article(noun), f"the {noun}", plural, f"some {plural}", plural.upper()):
        assert read_objects(words).things == (noun,), words
    assert read_objects("tyre").things == ("tyres",)


def test_several_nouns_are_told_apart(text: PlaceEncoder) -> None:
    assert read_objects("sofas, a coffee table and the garage door").things == ("coffee table", "garage door", "sofa")
    said = read_objects("a low coffee-table, a unicorn")
    assert (said.things, said.rest) == (("coffee table",), ("low", "unicorn"))


@pytest.mark.parametrize(
    ("words", "kinds"),
    [
        ("couches", ("sofa",)),
        ("TV, two tellies and the TV stand", ("sideboard", "television")),
        ("Bookcases", ("bookshelf",)),
        ("a closet", ("cupboard", "wardrobe")),
        ("tires", ("tyres",)),
        ("trash cans", ("bin", "dustbin", "litter bin")),
        ("a street light", ("lamp post",)),
        ("a lamp", ("ceiling lamp", "floor lamp")),
        ("office desks and an office chair", ("desk", "office chair")),
        ("a jungle gym and a sandbox", ("climbing frame", "sandpit")),
    ],
)
def test_furniture_has_other_names(text: PlaceEncoder, words: str, kinds: tuple[str, ...]) -> None:
    assert read_objects(words).things == kinds
    assert not read_objects(words).places


def test_every_name_is_that_of_its_kind_alone() -> None:
    for kind, others in OTHER_NAMES.items():
        for name in others:
            said = read_objects(f"the {name}")
            assert kind in said.things, name
            assert not said.places + said.rest, name
            assert said.things == (kind,), name
    for name, kinds in SEVERAL.items():
        assert read_objects(f"the {name}").things == tuple(sorted(kinds)), name
        assert {*kinds} < OTHER_NAMES.keys(), name
    assert {*LOOSE} < OTHER_NAMES.keys()


@pytest.mark.slow
def test_names_are_of_all_that_layouts_hold_and_of_nothing_else(text: PlaceEncoder) -> None:
    held = {kind for name in PLACES for seed in range(12) for kind in furnished(name, seed).layout.kinds}
    assert held <= OTHER_NAMES.keys()
    assert {noun for nouns in USUAL.values() for noun in nouns} <= OTHER_NAMES.keys() <= {*text.things}


def test_what_an_other_name_excludes_is_not_there(text: PlaceEncoder) -> None:
    plain, less = (choose_room(wanted(text, "a living room", words), AHEAD, 2) for words in ("", "couches"))
    assert "sofa" in plain.place.kinds
    assert less.place.kinds == tuple(kind for kind in plain.place.kinds if kind != "sofa")


def test_a_place_without_furniture_has_none(text: PlaceEncoder) -> None:
    room = choose_room(wanted(text, "a living room", "furniture"), AHEAD, 2)
    assert not {"sofa", "armchair", "sideboard", "coffee table", "bookshelf"} & {*room.place.kinds}
    assert {"window", "door", "television"} <= {*room.place.kinds}


@pytest.mark.parametrize(
    ("text", "empty"),
    [
        ("an empty office", True),
        ("a completely empty living room", True),
        ("a bare, cold room", True),
        ("the room is empty", True),
        ("a living room with bare walls", False),
        ("an office with an empty desk", False),
        ("a half empty office", False),
        ("a non-empty office", False),
    ],
)
def test_places_are_empty_and_not_their_desks(text: str, empty: bool) -> None:
    assert is_empty(text) is empty


def test_an_empty_place_holds_what_is_named_alone() -> None:
    backend = EmbeddedImageModel(read_model())
    bare = choose_room(backend.wanted("an empty office", ()), AHEAD, 2)
    assert not {*LOOSE} & {*bare.place.kinds}
    assert {"window", "door"} <= {*bare.place.kinds}
    request = backend.wanted("an unfurnished office with an office chair", ("door",))
    assert request.things == (("office chair",),)
    held = {*choose_room(request, AHEAD, 2).place.kinds}
    assert held & {*LOOSE, "door"} == {"office chair"}
    assert backend.wanted("an office", ("door",)) == PlaceRequest("office", (), ("door",))
    request = backend.wanted("an empty office with a chair", ())
    assert not request.excludes("office chair")
    assert request.excludes("desk")
    room = choose_room(request, AHEAD, 0)
    assert {*LOOSE} & {*room.place.kinds} <= {"chair", "office chair"}
    assert request.met(room.layout_from(replace(AHEAD, resolution=(64, 64))).kinds(room.place)) == [True]


def test_words_that_say_nothing_known_exclude_nothing(text: PlaceEncoder) -> None:
    for words in ("fridge", "blurry, low quality", "the woods", "", "floor, walls"):
        assert read_objects(words).things == ()


def test_captions_name_what_they_name(text: PlaceEncoder) -> None:
    rng = np.random.default_rng(5)
    for place, nouns in USUAL.items():
        for _ in range(10):
            said = caption(place, rng.permutation(np.array(nouns)).tolist(), rng, people=int(rng.integers(2)))
            named = {noun for noun in nouns if re.search(rf"\b{article(noun)}\b", said)}
            # "a table" is in no "a coffee table", but "a car" in "a car garage"
            assert named - {"car"} <= set(read_objects(said).things), said
            assert text.place_of(said)[0] == place, said


def test_every_name_of_a_place_names_it() -> None:
    for place, names in NAMES.items():
        for name in names:
            assert read_objects(f"in {article(name)}").places == (place,)
            assert read_objects(name).things == ()
    for words, place in (("a bed room", "bedroom"), ("hallways", "corridor"), ("a parlour", "living room")):
        assert read_objects(words).places == (place,)


@pytest.mark.parametrize("words", ["the woods", "a parking lot", "a kitchen with a table", "a garage door", "Munich"])
def test_other_places_are_not_named(text: PlaceEncoder, words: str) -> None:
    assert text.read(words).places == ()


def test_a_named_place_is_taken_whatever_else_is_said(text: PlaceEncoder) -> None:
    assert text.place_of("a swing, a slide, a tree, a hedge and a bench in an office")[0] == "office"


@pytest.mark.parametrize("prompt", ["a living room without a sofa", "an office, no desk", "a street but not a car"])
def test_a_negation_is_refused(prompt: str) -> None:
    with pytest.raises(PromptError, match=r"prompt: .* negates something .* negative="):
        check_words(prompt, "")
    with pytest.raises(PromptError, match=r"environment: .* negative_environment="):
        check_words(prompt, "", ("environment", "negative_environment"))
    with pytest.raises(PromptError, match=r"negative: .* negates what is left out already .* name just"):
        check_words("an office", prompt)
    check_words(prompt.split()[-1], "a plant")


@pytest.mark.parametrize(
    ("prompt", "negative", "words"),
    [
        ("a living room with two sofas", "sofa", "sofas"),
        ("a living room with a sofa", "television, couches", "sofa"),
        ("a bedroom with a wardrobe", "a closet", "wardrobe"),
        ("a bedroom with a floor lamp", "lamps", "floor lamp"),
        ("a street with parked cars", "car", "cars"),
        ("a lounge", "a plant, a living room", "living room"),
    ],
)
def test_what_is_asked_for_and_excluded_is_refused(prompt: str, negative: str, words: str) -> None:
    with pytest.raises(PromptError, match=rf"^prompt: '{prompt}' asks for '{words}', which negative '{negative}' excl"):
        check_words(prompt, negative)
    with pytest.raises(PromptError, match=r"^environment: .* which negative_environment "):
        check_words(prompt, negative, ("environment", "negative_environment"))


@pytest.mark.parametrize(
    ("prompt", "negative"),
    [
        ("a living room with a sofa", "armchair, a bedroom"),
        ("a bedroom with a lamp", "a floor lamp"),  # another lamp
        ("an office with an office chair", "chairs"),  # others
        ("an office", "an office desk"),
        ("a car garage", "a car"),
    ],
)
def test_what_leaves_something_to_be_had_is_allowed(prompt: str, negative: str) -> None:
    check_words(prompt, negative)


@pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning")
def test_every_model_refuses_negations_and_what_is_no_text(
    rooms: EnvironmentDiffusion, stable_diffusion: Path, model_folder: Path, wall: Callable[..., Pir]
) -> None:
    foreign = EnvironmentDiffusion(stable_diffusion, steps=1, device="cpu")
    for each in (rooms, foreign):
        with pytest.raises(PromptError, match=r"'without'.* negative="):
            each.generate("a living room without a sofa")
        with pytest.raises(PromptError, match=r"'without'.* negative="):
            each.generate_many(["an office", "an office without a desk"], seeds=[0, 1])
        with pytest.raises(PromptError, match=r"negative: 'no sofa' negates"):
            each.generate("a living room", negative="no sofa")
        with pytest.raises(PromptError, match=r"asks for 'sofa', which negative 'a couch' excludes"):
            each.generate("a living room with a sofa", negative="a couch")
        with pytest.raises(ValueError, match="negative is None"):
            each.generate("a living room", negative=None)  # type: ignore[arg-type]
    paths = PathDiffusion(model_folder, steps=1, samples=1, device="cpu")
    with pytest.raises(PromptError, match=r"'without'.* negative="):
        paths.refine(wall(4.0, replace(AHEAD, resolution=(64, 64))), "a living room without a sofa")


@pytest.mark.parametrize("seeds", [1, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("place", "thing"),
    [
        ("living room", "sofa"),
        ("classroom", "desk"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in (("bedroom", "bed"), ("office", "desk"), ("garage", "car"))
        ),
    ],
)
def test_what_is_excluded_is_in_no_sketch(text: PlaceEncoder, place: str, thing: str, seeds: int) -> None:
    request = wanted(text, article(place), thing)
    assert request.without == (thing,)
    for seed in range(seeds):
        room = choose_room(request, AHEAD, seed)
        assert thing not in room.place.kinds
        assert thing not in room.layout_from(AHEAD).kinds(room.place, 0.0)


def test_the_rest_of_a_room_stays_as_it_is_without_a_thing(text: PlaceEncoder) -> None:
    whole = choose_room(wanted(text, "an office"), AHEAD, 2)
    less = choose_room(wanted(text, "an office", "desks"), AHEAD, 2)
    assert less.offset == whole.offset
    assert less.place.kinds == tuple(kind for kind in whole.place.kinds if kind != "desk")
    before, after = whole.layout_from(AHEAD), less.layout_from(AHEAD)
    kind = np.array([*whole.place.kinds, ""])[before.piece]
    assert (kind == "desk").mean() > 0.01
    np.testing.assert_array_equal(after.range[kind != "desk"], before.range[kind != "desk"])
    assert (after.range[kind == "desk"] > before.range[kind == "desk"]).all()


def test_a_kind_goes_with_what_it_is_unless_it_is_wanted() -> None:
    """An office chair is a chair."""
    assert PlaceRequest("office", (), ("chair",)).excludes("office chair")
    assert not PlaceRequest("office", (("office chair",),), ("chair",)).excludes("office chair")
    assert PlaceRequest("office", (("chair",),), ("chair",)).excludes("chair")
    assert not PlaceRequest("lab", (), ("bench",)).excludes("workbench")


def test_who_wants_a_chair_has_it_in_an_office_chair() -> None:
    request = PlaceRequest("office", (("chair",), ("cupboard", "wardrobe"), ("bench",)))
    assert request.met(["office chair", "desk", "cupboard"]) == [True, True, False]
    assert request.met(["workbench"]) == [False, False, False]


@pytest.mark.parametrize("name", PLACES)
def test_floor_and_walls_stay_where_everything_else_is_left_out(name: str) -> None:
    place = PrimitiveScene.of(furnished(name, 3))
    assert place.without(()) is place
    bare = place.without(set(place.kinds))
    assert len(bare.kinds) == bare.shell == len(bare.bounding_boxes) == len(bare.parts)
    assert not {"door", "window", "garage door", "path"} & set(bare.kinds)
    assert {kind for kind in place.kinds if kind.split()[-1] in ("floor", "ground", "wall", "ceiling", "road")} - {
        "tool wall"
    } <= set(bare.kinds)
    np.testing.assert_array_equal(bare.owner, np.arange(bare.shell))


def test_doors_leave_whole_walls() -> None:
    view = replace(AHEAD, orientation=(0.5, 0.0, 0.0))
    place = PrimitiveScene.of(furnished("corridor", 3))
    less = PrimitiveScene.of(furnished("corridor", 3)).without(["door"])
    assert less.shell == place.shell - place.kinds.count("door")
    room, bare = (choose_room(PlaceRequest("corridor", (), kinds), view, 1) for kinds in ((), ("door",)))
    before, after = room.layout_from(view), bare.layout_from(view)
    doors = np.array([*room.place.kinds, ""])[before.piece] == "door"
    assert doors.mean() > 0.01
    assert np.isfinite(after.range).all()
    assert (after.range >= before.range - 1e-9).all()


@pytest.fixture(scope="module")
def rooms() -> EnvironmentDiffusion:
    return EnvironmentDiffusion(steps=1, sampler="dpm", device="cpu")


def test_drawing_warns_of_what_it_does_not_know(rooms: EnvironmentDiffusion) -> None:
    with pytest.warns(UnknownPlaceWarning, match=r"the woods.* nearest is taken: garage .*open field"):
        rooms.generate("the woods")
    with pytest.warns(UnknownThingWarning, match="'fridge' names nothing"):
        rooms.generate("a garage", negative="car, fridge, couch")
    with pytest.warns(AbsentThingWarning, match="a garage with a bed.*no suitable layout has 'bed'"):
        rooms.generate("a garage with a bed and a car")
    with pytest.warns(AbsentThingWarning, match="no suitable layout shows 'ceiling lamp' in this view"):
        rooms.generate("a bedroom with a bed and a ceiling lamp", orientation=(0.0, 0.4, 0.0))  # looks down
    # warnings are errors
    rooms.generate("a garage", negative="a car")
    rooms.generate("a garage with a bed and a car", orientation=(0.2, 0.0, 0.0))  # once for an environment


def test_a_radar_above_the_ceiling_is_told(rooms: EnvironmentDiffusion) -> None:
    with pytest.raises(ValueError, match=r"position: 4 m high, .* kind 'office' has a free spot .* ceiling .* m high"):
        rooms.generate("an office", position=(0.0, 0.0, 4.0))
    rooms.generate("a street", position=(0.0, 0.0, 4.0))


def test_what_walls_and_floors_are_made_of_is_heard() -> None:
    said = read_objects("a lab with walls of brick, a tiled floor and a rug")
    assert [(surface, finishes) for _, surface, finishes in said.surfaces] == [
        ("wall", ("brickwork",)), ("floor", ("tiles",)),
    ]  # fmt: skip
    assert said.things == ("rug",)
    assert read_objects("carpets").surfaces == ()
    assert PlaceRequest("lab", surfaces=(("wall", ("masonry",)), ("floor", ("tiles",)))).made(
        {"far wall": "plaster", "left wall": "masonry", "tool wall": "board", "floor": "linoleum"}
    ) == [True, False]


@pytest.mark.parametrize(
    ("prompt", "surface", "finish"),
    [
        ("a garage with brick walls", "left wall", "brickwork"),
        ("a lab with a tiled floor", "floor", "tiles"),
        pytest.param("a bedroom with a carpeted floor", "floor", "carpet", marks=pytest.mark.slow),
        pytest.param("a bedroom with a wooden floor", "floor", "floorboards", marks=pytest.mark.slow),
    ],
)
def test_layouts_are_chosen_by_what_they_are_made_of(prompt: str, surface: str, finish: str) -> None:
    said = read_objects(prompt)
    surfaces = tuple((where, meant) for _, where, meant in said.surfaces)
    found = {
        choose_room(PlaceRequest(said.places[0], surfaces=made_of), AHEAD, seed).place.finishes[surface]
        for seed in range(4)
        for made_of in (surfaces,)
    }
    assert found == {finish}
    plain = {choose_room(PlaceRequest(said.places[0]), AHEAD, seed).place.finishes[surface] for seed in range(8)}
    assert len(plain) > 1, "it is the words that choose"


def test_words_that_mean_nothing_are_told() -> None:
    """What is neither place nor furniture nor finish hardly changes a drawing over a sketch."""
    rooms = EnvironmentDiffusion(steps=1)
    with pytest.warns(UnknownWordsWarning, match="'grand piano', '30 m long' names no place"):
        rooms.generate("an office with a grand piano, 30 m long")
    with pytest.warns(AbsentThingWarning, match="no suitable layout has 'brick walls'"):
        rooms.generate("an office with brick walls")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rooms.generate("radar view of the inside of a furnished office with a carpeted floor")
        EnvironmentDiffusion(steps=1, use_layout_map=False).generate("an office with a grand piano")
