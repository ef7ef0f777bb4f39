"""Data sets of PIRs: what is in the files, that runs go on, and that splits share no layout."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment.layout_map import render_layout_map
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.generative.environment.requested_objects import NAMES
from rfgen_sionna.generative.environment.viewpoints import ViewpointRanges
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.scene import furnished as furnished_package
from rfgen_sionna.scene.furnished import furnished
from training.environment.pir_data import CONDITIONS, PLACES, SPLITS, DataError, PirData, shards, split_of
from training.environment.place_captions import USUAL, absent, caption, named
from training.environment.render import app, render
from training.environment.shards import Settings, coarse_model, render_layout
from training.environment.view_corpus import read_corpus

SMALL = Settings(resolution=(16, 16), views=2, seed=3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Twenty views of the ten places."""
    out = tmp_path_factory.mktemp("pirs")
    assert render(out, SMALL, 20) == 20
    return out


def test_places_are_those_that_can_be_furnished():
    assert PLACES == furnished_package.PLACES
    assert set(NAMES) == set(USUAL) == set(PLACES)


def test_schema(folder):
    """Every field has its dimensions, unit and type."""
    (file,) = shards(folder)
    with h5py.File(file) as shard:
        assert shard.attrs["format"] == "rfgen pir"
        assert shard.attrs["version"] == 3
        assert shard.attrs["kind"] == "environment"
        assert list(shard.attrs["places"]) == list(PLACES)
        assert json.loads(shard.attrs["command"])["seed"] == 3
        for name, unit in (("energy", "1"), ("time_of_arrival", "s"), ("velocity", "m/s")):
            assert shard[name].shape == (20, 16, 16)
            assert shard[name].dtype == np.float32
            assert shard[name].attrs["units"] == unit
            assert [d.label for d in shard[name].dims] == ["view", "row", "column"]
        for name in CONDITIONS:
            assert len(shard[name]) == 20
            assert shard[name].dims[0].label == "view"
            assert "units" in shard[name].attrs
        assert "energy_incomplete" not in shard


def test_images_are_physical(folder):
    data = PirData.open(folder)
    energy, arrival = data.energy(), data.time_of_arrival()
    assert ((energy > 0) == np.isfinite(arrival)).mean() > 0.99
    assert (energy[np.isfinite(arrival)] < 1e-4).all()
    ranges = 1.5e8 * arrival[np.isfinite(arrival)]
    assert ranges.min() > 0.3
    assert ranges.max() < 110
    assert not data.velocity().any()
    assert not data.actor().any()
    assert np.isfinite(arrival[data.places < 4]).all()  # rooms are closed


def test_conditions(folder):
    data = PirData.open(folder)
    assert len(data) == 20
    assert data.kind == "environment"
    assert set(data.places.tolist()) == set(range(10))
    assert (data.height >= 0.5).all()
    assert (data.height <= 2.0).all()
    np.testing.assert_array_equal(data.position[:, 2], data.height)
    assert (data.fov_deg >= 40).all()
    assert (data.fov_deg <= 100).all()
    np.testing.assert_allclose(data.fov_deg[:, 0], data.fov_deg[:, 1])
    assert np.degrees(data.pitch).min() >= -8.001
    assert np.degrees(data.pitch).max() <= 25.001
    assert set(data.projection) == {"perspective"}
    assert [split_of(seed) for seed in data.layout] == data.split
    for place, seen, without in zip(data.places, data.objects, data.absent, strict=True):
        assert seen
        assert not set(seen) & set(without)
        assert set(without) <= set(USUAL[PLACES[place]])


def test_roll_and_projection_are_conditions(tmp_path):
    """Drawn from their ranges, kept with each view, and what the images show."""
    ranges = ViewpointRanges(roll_deg=(-60, 60), projections=("perspective", "equirectangular"), fov_deg=(60, 90))
    settings = Settings(places=("bedroom", "office"), views=4, resolution=(12, 24), ranges=ranges)
    render(tmp_path, settings, 8)
    data = PirData.open(tmp_path)
    assert set(data.projection) == {"perspective", "equirectangular"}
    assert np.abs(data.roll).max() <= np.radians(60)
    assert len(np.unique(data.roll)) == 8
    assert data.take([3]).roll[0] == data.roll[3]
    views = read_corpus(data, PirCodec(), use_layout_map=True).views
    assert [(view.projection, view.roll) for view in views] == list(zip(data.projection, data.roll, strict=True))
    ranges_m = 0.5 * SPEED_OF_LIGHT * data.time_of_arrival()
    for k, facts in enumerate(views):
        shape = facts.fov_deg[1] / facts.fov_deg[0]
        assert shape == pytest.approx(0.5) if facts.projection == "equirectangular" else shape > 0.5
        position = tuple(data.position[k].tolist())
        view = View((12, 24), facts.fov_deg, position, (facts.yaw, facts.pitch, facts.roll), facts.projection)
        built = PrimitiveScene.of(furnished(PLACES[data.places[k]], int(data.layout[k])))
        level = replace(view, orientation=(facts.yaw, facts.pitch, 0.0), projection="perspective")
        right, wrong = (
            np.nanmean(np.abs(render_layout_map(built, each).range - ranges_m[k])) for each in (view, level)
        )
        # Bricks stand before what they stand for by decimetres; another roll or projection is off by more, unless it
        # turns no pixel by a third of a radian.
        assert right < 0.5
        assert right < 0.7 * wrong or np.allclose(view.directions, level.directions, atol=0.3)
    with pytest.raises(ValueError, match="projection is 'fisheye'"):
        ViewpointRanges(projections=("fisheye",))
    with pytest.raises(ValueError, match="roll_deg is"):
        ViewpointRanges(roll_deg=(-200, 0))
    around = ViewpointRanges(projections=("equirectangular",), fov_deg=(180, 360))
    Settings(ranges=around, resolution=(16, 32))
    with pytest.raises(ValueError, match="360 degrees across are 360 from top to bottom with 16 x 16 square pixels"):
        Settings(ranges=around, resolution=(16, 16))


def test_selecting_and_reading(folder):
    data = PirData.open(folder)
    streets = data.select(place="street")
    assert len(streets) == 2
    assert {PLACES[i] for i in streets.places} == {"street"}
    both = data.select(place=["street", "lab"])
    assert len(both) == 4
    np.testing.assert_array_equal(data.energy([5, 3]), data.energy()[[5, 3]])
    np.testing.assert_array_equal(streets.energy(), data.energy(np.flatnonzero(data.places == PLACES.index("street"))))
    assert sum(len(data.select(split)) for split in SPLITS) == len(data)
    assert len(data.select(people=True)) == 0
    assert data.select(people=True).energy().shape == (0, 16, 16)


def test_splits_are_disjoint_and_sized():
    """A layout is in one split whatever the data set, and the shares are as said."""
    found = [split_of(seed) for seed in range(20000)]
    shares = [found.count(split) / len(found) for split in SPLITS]
    np.testing.assert_allclose(shares, (0.8, 0.1, 0.1), atol=0.01)
    assert [split_of(seed) for seed in range(100)] == found[:100]


def test_no_layout_is_in_two_splits(folder):
    data = PirData.open(folder)
    rooms = {
        split: set(zip(data.select(split).places.tolist(), data.select(split).layout.tolist(), strict=True))
        for split in SPLITS
    }
    for one in SPLITS:
        for other in SPLITS:
            assert one == other or not rooms[one] & rooms[other]
    assert not {seed for _, seed in rooms["train"]} & {seed for _, seed in rooms["test"]}


def test_data_sets_of_two_seeds_share_no_layout(folder):
    other = render_layout(replace(SMALL, seed=4), 0, 1)[0]
    assert other["layout"] not in PirData.open(folder).layout


@pytest.mark.slow
def test_runs_go_on(tmp_path):
    """Whole shards are kept to the byte, a larger count adds to them, a shard cut short is made again."""
    settings = replace(SMALL, places=("corridor",), views=1, resolution=(8, 8))
    assert render(tmp_path, settings, 17) == 17
    first, second = shards(tmp_path)
    before, stamp = first.read_bytes(), first.stat().st_mtime_ns
    assert render(tmp_path, settings, 17) == 0
    second.unlink()
    (tmp_path / ".shard-00001.h5.77.part").write_bytes(b"cut short")
    assert render(tmp_path, settings, 18) == 2
    assert first.read_bytes() == before
    assert first.stat().st_mtime_ns == stamp
    assert len(PirData.open(tmp_path)) == 18


def test_other_settings_are_refused(folder):
    with pytest.raises(DataError, match="made with other settings"):
        render(folder, replace(SMALL, seed=9), 20)


def test_folders_from_before_there_was_roll_go_on(tmp_path):
    settings = Settings(places=("open field",), views=1, resolution=(8, 8))
    render(tmp_path, settings, 1)
    (file,) = shards(tmp_path)
    with h5py.File(file, "r+") as shard:
        said = json.loads(shard.attrs["command"])
        del said["ranges"]["roll_deg"], said["ranges"]["projections"]
        shard.attrs["command"] = json.dumps(said, sort_keys=True)
    assert render(tmp_path, settings, 2) == 2
    with pytest.raises(DataError, match="made with other settings"):
        render(tmp_path, replace(settings, ranges=ViewpointRanges(roll_deg=(0, 5))), 2)


def test_interrupted_shards_leave_nothing(tmp_path, monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("training.environment.shards._write", fail)
    with pytest.raises(KeyboardInterrupt):
        render(tmp_path, replace(SMALL, places=("corridor",), resolution=(8, 8)), 1)
    assert not list(tmp_path.iterdir())


def test_same_settings_same_views(folder):
    again = render_layout(SMALL, 1, 1)[0]
    data = PirData.open(folder)
    np.testing.assert_array_equal(again["energy"], data.energy([2])[0])
    assert again["caption"] == data.captions[2]


def test_pairs_lack_something():
    """Incomplete renders see other materials and less furniture from the same place."""
    view = render_layout(replace(SMALL, kind="pairs", places=("office",)), 0, 1)[0]
    both = np.isfinite(view["time_of_arrival"]) & np.isfinite(view["time_of_arrival_incomplete"])
    assert both.mean() > 0.9
    difference = 10 * np.log10(view["energy"][both] / view["energy_incomplete"][both])
    assert 1.0 < np.abs(difference).mean() < 20.0


@pytest.mark.slow
def test_people_in_pairs():
    """The same person in both renders, moving where somebody walks."""
    pytest.importorskip("anny")
    settings = replace(SMALL, kind="pairs", people=1.0, places=("living room",), resolution=(32, 32))
    views = render_layout(settings, 0, 2)
    assert any(view["people"] for view in views)
    for view in views:
        assert bool(view["actor"].any()) <= bool(view["people"])
        if view["people"]:
            assert "person" in view["caption"]


def test_command_line(tmp_path):
    out = tmp_path / "set"
    runner = CliRunner()
    options = ["--out", str(out), "--resolution", "8", "--places", "corridor, lab", "--views", "1", "--workers", "1"]
    result = runner.invoke(app, [*options, "--count", "3"])
    assert result.exit_code == 0, result.output
    assert "3 views rendered" in result.output
    # A shard that is to be larger is made anew.
    assert "4 views rendered, 4 in" in runner.invoke(app, [*options, "--count", "4"]).output
    wrong = runner.invoke(app, [*options, "--count", "4", "--seed", "1"])
    assert wrong.exit_code == 2
    assert "other settings" in wrong.output
    render_layout_map = runner.invoke(app, ["--help"]).output
    for word in ("--preset", "--kind", "--people", "--fov", "goes on"):
        assert word in render_layout_map


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kind": "other"}, "kind is 'other'"),
        ({"places": ("moon",)}, "places holds 'moon'"),
        ({"places": ()}, "places holds 'nothing'"),
        ({"people": 2.0}, "people is 2.0"),
        ({"resolution": (2, 2)}, "resolution"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_bad_settings(options, message):
    with pytest.raises(DataError, match=message):
        replace(SMALL, **options)


def test_bad_ranges_and_folders(tmp_path, folder):
    with pytest.raises(ValueError, match=r"height is \(2, 1\)"):
        ViewpointRanges(height=(2, 1))
    with pytest.raises(DataError, match="holds no shards"):
        PirData.open(tmp_path)
    (tmp_path / "shard-00000.h5").write_bytes(b"no HDF5")
    with pytest.raises(DataError, match="cannot be read"):
        PirData.open(tmp_path)
    data = PirData.open(folder)
    with pytest.raises(DataError, match="split is 'all'"):
        data.select("all")
    with pytest.raises(DataError, match="place is 'moon'"):
        data.select(place="moon")
    with pytest.raises(DataError, match="no field 'energy_incomplete'"):
        data.incomplete()


@pytest.mark.parametrize("place", PLACES)
def test_captions(place):
    """Many wordings, each names the place, and things that are there and no others."""
    rng = np.random.default_rng(0)
    seen = ["floor", "far wall", *USUAL[place][:4], "ceiling"]
    found = {caption(place, seen, rng) for _ in range(300)}
    assert len(found) > 50
    for text in found:
        assert any(name in text for name in NAMES[place]), text
        assert "wall" not in text
        for thing in set(USUAL[place][4:]) - set(seen):
            assert f"a {thing}" not in text
    assert "person" in caption(place, seen, rng, people=1)
    bare = caption(place, [], rng)
    assert any(name in bare for name in NAMES[place])
    assert named(seen) == list(USUAL[place][:4])
    without = absent(place, USUAL[place][:2])
    assert without == list(USUAL[place][2:])


def test_a_coarse_model_lacks_furniture_and_materials():
    scene = furnished("living room", 0)
    coarse = coarse_model(scene, np.random.default_rng(0), (0.3, 0.5))
    assert 0.5 * len(scene.layout.items) <= len(coarse.layout.items) <= 0.7 * len(scene.layout.items) + 1
    assert {item.material for item in coarse.objects} == {"concrete", "wood"}
    shell = scene.owners.count(-1)
    for a, b in zip(scene.objects[:shell], coarse.objects[:shell], strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
