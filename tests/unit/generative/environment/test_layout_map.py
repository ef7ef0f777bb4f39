"""Sketches show a furnished place of bricks, where its render has the things themselves; rooms show what is wanted."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment import room_selection as rooms
from rfgen_sionna.generative.environment.conditional_prior import LatentPrior
from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, ModelFileError, read_model
from rfgen_sionna.generative.environment.image_generation import ImageRequest, generate_images, with_layout_maps
from rfgen_sionna.generative.environment.image_sampling import Conditioning, ImageSampler, noise_like, sample_images
from rfgen_sionna.generative.environment.layout_map import CHANNELS, NO_LAYOUT_MAP, render_layout_map
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.generative.environment.primitives import Primitives, PrimitiveScene, fit_primitives
from rfgen_sionna.generative.environment.room_selection import FIRST_SEED, PlaceRequest, choose_room
from rfgen_sionna.generative.environment.view_unet import KINDS, make_scheduler
from rfgen_sionna.generative.environment.viewpoints import PlaceRenderer, Viewpoint, choose_viewpoint
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.furnished.finishes import FINISHES
from rfgen_sionna.scene.furnished.piece import corners, legs
from rfgen_sionna.scene.furnished.shapes import block, joined, leaves, pipe
from training.environment.fits import brightness_offsets, fit_conditional_prior
from training.environment.pir_data import PLACES, PirData
from training.environment.render import render
from training.environment.shards import LAYOUTS as LAYOUTS_OF_A_SET
from training.environment.shards import Settings
from training.environment.view_corpus import ViewCorpus, mirrored_layout_map

CODEC = PirCodec()
AHEAD = View((32, 32), (70.0, 70.0), (0.0, 0.0, 1.0), (0.0, 0.1, 0.0))


def primitive(centre: tuple[float, ...], half: tuple[float, ...], yaw: float = 0.0) -> PrimitiveScene:
    return PrimitiveScene.plain(Primitives.upright(np.array([centre]), np.array([half]), np.array([yaw])), ("box",))


def test_a_box_is_where_geometry_puts_it() -> None:
    """A cube of edge 1 m whose front is 2.5 m ahead: range over cosine is its distance, its edges lie at 0.5 / 2.5."""
    view = View((64, 64), (40.0, 40.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    layout_from = render_layout_map(primitive((3.0, 0.0, 1.0), (0.5, 0.5, 0.5)), view)
    there = layout_from.piece >= 0
    np.testing.assert_allclose((layout_from.range * layout_from.cosine)[there], 2.5, rtol=1e-9)
    expected = (0.5 / 2.5 / np.tan(np.radians(20.0))) ** 2
    assert there.mean() == pytest.approx(expected, abs=0.03)
    np.testing.assert_allclose(layout_from.place[there][:, 0], -1.0, atol=1e-9)
    assert layout_from.place[32, 32, 1:] == pytest.approx([0.0, 0.0], abs=0.05)
    # turned by 45 degrees an edge is ahead, and both of its sides lie at an angle
    turned = render_layout_map(primitive((3.0, 0.0, 1.0), (0.5, 0.5, 0.5), np.pi / 4), view)
    assert turned.range[32, 31:33] == pytest.approx([3.0 - np.sqrt(0.5)] * 2, abs=0.02)
    assert turned.cosine[32, 32] == pytest.approx(np.sqrt(0.5), abs=0.02)


def test_nothing_is_seen_from_within_or_behind() -> None:
    inside = render_layout_map(primitive((0.0, 0.0, 1.0), (1.0, 1.0, 1.0)), AHEAD)
    behind = render_layout_map(primitive((-3.0, 0.0, 1.0), (1.0, 1.0, 1.0)), AHEAD)
    for layout_map in (inside, behind):
        assert (layout_map.piece == -1).all()
        assert np.isnan(layout_map.range).all()


def test_an_ellipsoid_is_where_geometry_puts_it() -> None:
    """A ball of radius 1 m whose middle is 4 m ahead: its front at 3 m, its rim where sin(angle) is 1 / 4, and the
    incidence on it by the law of sines. Stretched and turned, it is what it was in stretched and turned coordinates."""
    view = View((64, 64), (40.0, 40.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    ball = Primitives(np.array([[4.0, 0.0, 1.0]]), np.ones((1, 3)), np.eye(3)[None], np.ones(1, bool))
    layout_from = render_layout_map(PrimitiveScene.plain(ball, ("ball",)), view)
    angle = np.arccos(view.directions @ (1.0, 0.0, 0.0))
    np.testing.assert_array_equal(layout_from.piece == 0, np.sin(angle) < 0.25)
    there = layout_from.piece == 0
    np.testing.assert_allclose(
        layout_from.range[there], 4 * np.cos(angle[there]) - np.sqrt(1 - 16 * np.sin(angle[there]) ** 2), rtol=1e-9
    )
    np.testing.assert_allclose(np.sqrt(1 - layout_from.cosine[there] ** 2), 4 * np.sin(angle[there]), atol=1e-6)
    turn = Rotation.from_euler("zyx", [0.4, -0.3, 0.7]).as_matrix()
    egg = Primitives(ball.centre, np.array([[0.8, 0.4, 0.6]]), turn.T[None], ball.round)
    enters, _ = egg.cast(view.position, view.directions.reshape(-1, 3))
    met = np.isfinite(enters[0])
    points = np.array(view.position) + enters[0][met][:, None] * view.directions.reshape(-1, 3)[met]
    np.testing.assert_allclose(np.linalg.norm(egg.own(points, np.zeros(met.sum(), np.intp)), axis=1), 1.0)


def test_a_table_is_built_of_a_top_and_four_legs() -> None:
    table = joined([block(1.6, 0.8, 0.04, z=0.7), *legs(corners(1.6, 0.8, 0.08), 0.7, 0.03, "wood")])
    primitives = fit_primitives(table.points, table.faces, np.eye(3))
    assert len(primitives) == 5
    assert not primitives.round.any()
    assert primitives.volume < 0.1 * 1.6 * 0.8 * 0.74
    # from below the top one sees out on the other side
    view = View((32, 32), (30.0, 30.0), (-3.0, 0.0, 0.35), (0.0, 0.0, 0.0))
    whole = Primitives.upright(np.array([[0.0, 0.0, 0.37]]), np.array([[0.8, 0.4, 0.37]]), np.zeros(1))
    layout_from = render_layout_map(PrimitiveScene(whole, ("table",), 0, primitives, np.zeros(5, np.intp)), view)
    assert (layout_from.piece[16] < 0).mean() > 0.7


def test_a_tilted_bar_is_one_slim_brick_and_a_heap_of_leaves_one_crown() -> None:
    bar = pipe([(0.0, 0.0, 0.0), (1.0, 0.5, 1.2)], 0.02)
    slim = fit_primitives(bar.points, bar.faces, np.eye(3))
    assert len(slim) == 1
    assert slim.volume < 2.0 * np.linalg.norm([1.0, 0.5, 1.2]) * 0.04**2
    rng = np.random.default_rng(0)
    places = rng.normal(size=(400, 3))
    places *= rng.uniform(size=(400, 1)) ** (1 / 3) / np.linalg.norm(places, axis=1, keepdims=True)
    crown = leaves(places * (1.5, 1.5, 2.0) + (0.0, 0.0, 3.0), 0.1, rng)
    one = fit_primitives(crown.points, crown.faces, np.eye(3))
    assert len(one) == 1
    assert one.round.all()
    np.testing.assert_allclose(np.sort(one.half[0]), [1.5, 1.5, 2.0], rtol=0.15)


@pytest.mark.parametrize("place", PLACES)
def test_a_sketch_is_the_place_that_is_rendered(place: str) -> None:
    """No box is behind what stands in it, and floor and walls, which are boxes themselves, agree."""
    radar = Radar.load("awr1843")
    scene = furnished(place, 11)
    renderer = PlaceRenderer(scene, radar)
    viewpoint: Viewpoint = choose_viewpoint(renderer, np.random.default_rng(2), Settings().ranges)
    built_up = PrimitiveScene.of(scene)
    view = viewpoint.view((32, 32))
    layout_map = render_layout_map(built_up, view)
    objects, distance = renderer.first_hits(viewpoint, 32, 32)
    real = np.where(objects >= 0, distance, np.inf).reshape(32, 32)
    boxes = np.where(np.isfinite(layout_map.range), layout_map.range, np.inf)
    with np.errstate(invalid="ignore"):
        # Hills of a meadow stand before its plane; doors and windows lie in their walls, of which theirs stand out.
        assert (boxes > 1.02 * real + 0.15).mean() < (0.1 if place == "open field" else 0.01)
        opening = np.array([kind in ("door", "window", "garage door") for kind in (*built_up.kinds, "")])
        shell = (layout_map.piece >= 0) & (layout_map.piece < built_up.shell) & ~opening[layout_map.piece]
        agree = np.abs(boxes - real)[shell & np.isfinite(real)] < 0.02 * real[shell & np.isfinite(real)] + 0.15
    assert agree.mean() > 0.9


@pytest.mark.slow
def test_a_data_set_has_the_sketch_of_each_view(tmp_path) -> None:
    render(tmp_path, Settings(resolution=(16, 16), views=1, seed=3), 10)
    data = PirData.open(tmp_path)
    known = ("floor", "ground", "far wall")
    got = data.layout_maps(known, CODEC)
    assert got.shape == (10, CHANNELS, 16, 16)
    for k in range(10):
        place = PrimitiveScene.of(furnished(PLACES[data.places[k]], int(data.layout[k])))
        view = View(
            (16, 16), tuple(data.fov_deg[k]), tuple(data.position[k]), (float(data.yaw[k]), float(data.pitch[k]), 0.0)
        )
        np.testing.assert_allclose(got[k], render_layout_map(place, view).channels(place, known, CODEC), atol=2e-3)
    assert set(np.unique(got[:, -1])) <= {0.0, 1.0, 2.0, 3.0}
    np.testing.assert_array_equal(got[[4, 1]], data.layout_maps(known, CODEC, [4, 1]))


def test_the_mirror_image_of_a_sketch_is_that_of_the_mirrored_place() -> None:
    view = replace(AHEAD, orientation=(0.2, 0.1, 0.0))
    one = primitive((3.0, 0.6, 0.8), (0.4, 0.7, 0.5), 0.3)
    other = primitive((3.0, -0.6, 0.8), (0.4, 0.7, 0.5), np.pi - 0.3)  # its front is mirrored, and its left
    flipped = render_layout_map(other, replace(view, orientation=(-0.2, 0.1, 0.0))).channels(other, ("box",), CODEC)
    own = mirrored_layout_map(render_layout_map(one, view).channels(one, ("box",), CODEC))
    np.testing.assert_allclose(own, flipped, atol=1e-6)


@pytest.fixture(scope="module")
def reader(model: EnvironmentModel, corpus: ViewCorpus) -> EnvironmentModel:
    """A model that expects what the corpus of walls has taught it, and whose network says nothing."""
    unet = deepcopy(model.unet)
    for parameter in unet.conv_out.parameters():
        torch.nn.init.zeros_(parameter)
    unet.spread.fill_(1.3)
    return replace(model, unet=unet, conditional_prior=fit_conditional_prior(corpus, KINDS, model.vae, CODEC))


def a_wall(distance: float, facts: ViewFacts) -> tuple[np.ndarray, np.ndarray]:
    """(1, CHANNELS, row, column) sketch of a wall and a floor, and the ranges (row, column) [m]."""
    centre, half = [[0.0, 0.0, 0.0], [distance, 0.0, 0.0]], [[50.0, 50.0, 0.0], [0.0, 50.0, 50.0]]
    place = PrimitiveScene.plain(
        Primitives.upright(np.array(centre), np.array(half), np.zeros(2)), ("floor", "far wall"), 2
    )
    view = View((64, 64), facts.fov_deg, (0.0, 0.0, facts.height), (facts.yaw, facts.pitch, 0.0))
    layout_map = render_layout_map(place, view)
    return layout_map.channels(place, ("far wall",), CODEC)[None], layout_map.range


def test_what_is_expected_of_a_wall_is_a_wall(reader: EnvironmentModel) -> None:
    """At other distances than those it learnt from: range, and level over range. Where nothing else stands, little
    strays from that."""
    assert reader.conditional_prior is not None
    facts = ViewFacts((60.0, 60.0), 1.1, 0.1, 0.0)
    layout_map, reach = a_wall(4.7, facts)
    plain = np.zeros(KINDS)
    got = reader.conditional_prior.image(layout_map[0], facts, CODEC, plain)
    energy, arrival, _ = CODEC.decode_arrays(got, clip=True)
    np.testing.assert_allclose(0.5 * SPEED_OF_LIGHT * arrival, reach, rtol=0.05)
    np.testing.assert_allclose(10 * np.log10(energy), -130 - 20 * np.log10(reach / 3.0), atol=1.5)
    found = reader.conditional_prior.of(layout_map, [facts], [plain], reader.vae, CODEC)
    assert found.mean.shape == found.spread.shape == (1, 32, 16, 16)
    assert float(found.spread.median()) < 0.3
    with pytest.raises(ValueError, match="has none"):
        reader.conditional_prior.of(np.full((1, CHANNELS, 64, 64), NO_LAYOUT_MAP), [facts], [plain], reader.vae, CODEC)


def test_how_bright_a_thing_is_comes_from_its_finish_and_the_seed(reader: EnvironmentModel, corpus: ViewCorpus) -> None:
    assert reader.conditional_prior is not None
    table = np.stack([np.full((3, KINDS), 0.1), np.full((3, KINDS), 0.05)])
    table[0, 2] = -0.4
    learnt = replace(reader.conditional_prior, brighter=table, finishes=("plaster", "brickwork"))
    made_of = {"far wall": "brickwork", "left wall": "plaster", "a ghost": "brickwork"}
    things = ("far wall", "left wall", "right wall")
    drawn = np.array([learnt.sample_brightness(made_of, things, seed) for seed in range(400)])
    np.testing.assert_array_equal(learnt.rows(made_of, things)[:5], [0, 2, 1, 0, 0])
    np.testing.assert_allclose(np.delete(drawn, 1, axis=1).mean(axis=0), 0.1, atol=0.015)
    assert drawn[:, 1].mean() == pytest.approx(-0.4, abs=0.015)
    np.testing.assert_allclose(drawn.std(axis=0), 0.05, rtol=0.15)
    np.testing.assert_array_equal(drawn[3], learnt.sample_brightness(made_of, things, 3))
    facts, (layout_map, _) = corpus.views[0], a_wall(4.0, corpus.views[0])
    bright = np.zeros(KINDS)
    bright[1] = 0.2
    image = learnt.image(layout_map[0], facts, CODEC, bright)
    found = brightness_offsets(learnt, image, layout_map[0], facts, CODEC)
    assert found[1] == pytest.approx(0.2, abs=0.02)
    assert np.abs(np.delete(found, 1)).max() < 0.02


def test_walls_are_as_bright_as_what_they_are_made_of() -> None:
    """Concrete returns more than plasterboard in training views, and a drawn room of it does, too."""
    model = read_model()
    assert model.conditional_prior is not None
    offsets = {
        finish: model.conditional_prior.sample_brightness({"far wall": finish}, model.text.things, 1)[
            1 + model.text.things.index("far wall")
        ]
        for finish in ("plaster", "masonry")
    }
    low, high = model.codec.energy_db
    assert 0.5 * (high - low) * (offsets["masonry"] - offsets["plaster"]) > 3.0
    scene = furnished("office", 5)
    assert {"far wall", "floor", "desk"} <= scene.finishes.keys() == {*scene.kinds}
    assert PrimitiveScene.of(scene).finishes == scene.finishes
    for kind, finish in scene.finishes.items():
        own = {item.material for name, item in zip(scene.kinds, scene.objects, strict=True) if name == kind}
        assert FINISHES[finish].material in own, kind


@pytest.mark.slow
def test_a_network_that_says_nothing_draws_a_normal_distribution_about_what_is_expected(
    reader: EnvironmentModel, corpus: ViewCorpus
) -> None:
    """Closed form: of noise e comes m + s e with a sketch, and s e without one, whatever the words and the guidance."""
    facts = [corpus.views[0]]
    tokens, against = reader.text.embed(["a bedroom"], facts), reader.text.embed([""], facts)
    noise = noise_like(1, reader, 1)
    conditioning = with_layout_maps(reader, Conditioning(), a_wall(4.0, facts[0])[0], facts, [np.zeros(KINDS)])
    assert conditioning.expected is not None
    incomplete = LatentPrior(
        conditioning.expected.mean, torch.full_like(noise, 0.4)
    )  # as path diffusion has it: without a sketch
    for told, mean, spread in (
        (conditioning, conditioning.expected.mean, conditioning.expected.spread),
        (Conditioning(expected=incomplete), incomplete.mean, 0.4),
        (Conditioning(), 0.0, 1.3),
    ):
        drawn = sample_images(reader, make_scheduler(), ImageSampler("ddim", 250, 2.0), tokens, against, noise, told)
        expected = reader.vae.decode(mean + spread * noise).sample.clamp(-1, 1).numpy()
        assert np.abs(drawn - expected).mean() < 0.02 * np.abs(expected).mean() + 0.01


def test_a_sketch_needs_a_model_that_reads_them(model: EnvironmentModel, corpus: ViewCorpus) -> None:
    facts = corpus.views[:1]
    with pytest.raises(ModelFileError, match="reads no layout maps"):
        with_layout_maps(model, Conditioning(), a_wall(4.0, facts[0])[0], facts, [np.zeros(KINDS)])


def test_rooms_are_no_layouts_of_a_data_set_and_leave_space_for_somebody() -> None:
    assert FIRST_SEED > 1000 * LAYOUTS_OF_A_SET
    view = replace(AHEAD, resolution=(64, 64), orientation=(0.0, 0.0, 0.0))
    for place in ("living room", "office", "garage"):
        room = choose_room(PlaceRequest(place), view, 5)
        assert room.offset == (0.0, 0.0)
        middle = room.layout_from(view).range[31:33, 31:33]
        assert (middle > 4.0).all(), "somebody stands at 1.2 to 4.3 m"
    one, again, other = (choose_room.__wrapped__(PlaceRequest("office"), view, seed) for seed in (1, 1, 2))
    here, same, elsewhere = (room.place.bounding_boxes.centre for room in (one, again, other))
    np.testing.assert_array_equal(here, same)
    assert here.shape != elsewhere.shape or not np.allclose(here, elsewhere)


@pytest.mark.slow
def test_rooms_show_what_words_name_and_not_what_they_exclude() -> None:
    view = replace(AHEAD, resolution=(64, 64))
    render_layout_map, bare, without = 0, 0, 0
    for seed in range(12):
        for wanted in (PlaceRequest("living room", (("television",),)), PlaceRequest("living room")):
            room = choose_room(wanted, view, seed, anywhere=True)
            layout_from = "television" in room.layout_from(view).kinds(room.place)
            render_layout_map, bare = (
                (render_layout_map + layout_from, bare) if wanted.things else (render_layout_map, bare + layout_from)
            )
        room = choose_room(PlaceRequest("living room", (), ("television",)), view, seed, anywhere=True)
        without += "television" in room.layout_from(view).kinds(room.place)
    assert render_layout_map >= 11 > bare + 2
    assert without == 0


def test_what_a_coarse_look_takes_for_shown_is_looked_for_further(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = rooms._score

    def hasty(room: rooms.Room, view: View, wanted: PlaceRequest) -> float:
        coarse = view.resolution == rooms._COARSE
        return float(len(wanted.things)) if coarse else honest(room, view, wanted)

    monkeypatch.setattr(rooms, "_score", hasty)
    view, request = replace(AHEAD, resolution=(64, 64)), PlaceRequest("living room", (("television",),))
    for seed in range(4):
        room = choose_room.__wrapped__(request, view, seed, anywhere=True)
        assert request.met(room.layout_from(view).kinds(room.place)) == [True]


def test_other_views_of_a_room_see_the_same_room(model: EnvironmentModel) -> None:
    """A step aside, the same point of a wall lies where it lay."""
    first = View((64, 64), (60.0, 60.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    room = choose_room(PlaceRequest("lab"), first, 3)
    second = replace(first, position=(0.0, 0.3, 1.0), orientation=(0.1, 0.0, 0.0))
    a, b = room.layout_from(first), room.layout_from(second)
    points = np.array(first.position) + a.range[..., None] * first.directions
    where = second.pixels(points - np.array(second.position))
    there = (where >= 0) & np.isfinite(a.range)
    expected = np.linalg.norm(points[there] - np.array(second.position), axis=-1)
    got = b.range.ravel()[where[there]]
    assert np.median(np.abs(got - expected)) < 0.05
    facts = ViewFacts(first.fov_deg, 1.0, 0.0, 0.0)
    tokens, against = model.text.embed(["a lab"], [facts]), model.text.embed([""], [facts])
    request = ImageRequest(PlaceRequest("lab"), second, 3, first)
    image = generate_images(
        model, make_scheduler(), ImageSampler("ddim", 1, 1.0), [request], tokens, against, noise_like(1, model, 1)
    )
    assert image.shape == (1, 3, 64, 64)
