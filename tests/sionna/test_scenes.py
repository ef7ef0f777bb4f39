"""Scenes load, and follow the radar's frequency, in Sionna itself."""

import importlib.util
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rfgen_sionna.resources import resolve
from rfgen_sionna.scene import (
    MATERIALS,
    MaterialError,
    MaterialRangeWarning,
    MeshActor,
    RayScene,
    SceneError,
    available_scenes,
    check_radar_clear,
    load_scene,
    material,
)
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.scene.scattering import ScatteringPattern
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.sionna.sensing_target import add_actor
from tests.benchmarks.subjects import radar_of
from tests.sionna.rectangles import apart, scene_of, wall

SMALL = [
    "box",
    "box_knife",
    "box_one_screen",
    "box_two_screens",
    "double_reflector",
    "floor_wall",
    "simple_reflector",
    "simple_street_canyon",
    "simple_street_canyon_with_cars",
    "simple_wedge",
    "triple_reflector",
]
LARGE = ["etoile", "florence", "munich", "san_francisco"]
RADAR_BANDS = (24.125e9, 60e9, 76e9, 77e9, 81e9)


@pytest.fixture(scope="module")
def rt():
    ensure_backend()
    import sionna.rt

    return sionna.rt


@pytest.fixture(scope="module")
def room():
    return load_scene("living_room")


def test_every_scene_of_sionna_is_known():
    assert {*SMALL, *LARGE, "living_room"} <= set(available_scenes())


@pytest.mark.parametrize("name", [*SMALL, pytest.param("munich", marks=pytest.mark.slow)])
def test_every_scene_works_at_every_radar_frequency(name):
    scene = load_scene(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MaterialRangeWarning)
        for frequency in RADAR_BANDS:
            scene.tune(frequency)
            assert float(scene.sionna.frequency[0]) == pytest.approx(frequency, rel=1e-6)
            for item in scene.objects:
                ours = complex(item.properties.relative_permittivity(frequency))
                theirs = scene.sionna.objects[item.name].radio_material
                assert float(theirs.relative_permittivity[0]) == pytest.approx(ours.real, rel=1e-6)
                assert float(theirs.conductivity[0]) == pytest.approx(
                    float(item.properties.conductivity(frequency)), rel=1e-5
                )
    assert scene.objects


def test_extrapolation_is_said_once_for_all_materials():
    with pytest.warns(MaterialRangeWarning, match="brick.*marble") as caught:
        load_scene("simple_street_canyon").tune(77e9)
    assert len(caught) == 1


def test_the_strict_policy_names_object_and_frequency():
    with pytest.raises(MaterialError, match=r"wall: material 'brick' is not defined at 77 GHz"):
        load_scene("floor_wall", outside="raise").tune(77e9)


def test_our_table_is_sionnas_within_its_ranges(rt):
    from sionna.rt.radio_materials.itu import ITU_MATERIALS_PROPERTIES

    assert set(ITU_MATERIALS_PROPERTIES) <= set(MATERIALS)
    for name, ranges in ITU_MATERIALS_PROPERTIES.items():
        for (low, high), (a, b, c, d) in ranges.items():
            if (low, high) == (100.0, 400.0):
                continue  # overlaps the narrower ranges, which come first
            for ghz in (1.001 * low, np.sqrt(low * high), 0.999 * high):
                found = material(name)
                assert complex(found.relative_permittivity(ghz * 1e9)).real == pytest.approx(a * ghz**b)
                assert float(found.conductivity(ghz * 1e9)) == pytest.approx(c * ghz**d, rel=1e-9)


def test_a_scene_of_the_user_is_retuned_in_place(rt):
    given = rt.load_scene(rt.scene.floor_wall)
    with pytest.raises(ValueError, match="not defined"):
        given.frequency = 77e9
    given.frequency = 24e9
    scene = load_scene(given)
    assert scene.sionna is given
    with pytest.warns(MaterialRangeWarning, match="brick"):
        scene.tune(77e9)
    given.frequency = 79e9
    brick = given.radio_materials["brick"]
    assert float(brick.relative_permittivity[0]) == pytest.approx(
        complex(material("brick").relative_permittivity(79e9)).real, rel=1e-6
    )
    assert {o.name: o.material for o in scene.objects} == {"floor": "concrete", "wall": "brick"}


def test_a_material_of_the_users_own_keeps_its_constants_and_its_callback(rt):
    given = rt.load_scene(rt.scene.floor_wall)
    given.objects["wall"].radio_material = rt.RadioMaterial(
        "clay", thickness=0.3, relative_permittivity=4.5, conductivity=0.2, scattering_coefficient=0.25
    )
    given.objects["floor"].radio_material = rt.RadioMaterial(
        "screed", frequency_update_callback=lambda f: (2.0 + f / 77e9, 0.1)
    )
    clay, screed = (next(o for o in load_scene(given).objects if o.material == name) for name in ("clay", "screed"))
    assert clay.properties.thickness == pytest.approx(0.3)
    assert clay.properties.scattering_coefficient == pytest.approx(0.25)
    for frequency in (24e9, 77e9):
        assert complex(clay.properties.relative_permittivity(frequency)).real == pytest.approx(4.5)
        assert float(clay.properties.conductivity(frequency)) == pytest.approx(0.2, rel=1e-6)
    assert complex(screed.properties.relative_permittivity(77e9)).real == pytest.approx(3.0, rel=1e-6)


def test_our_materials_serve_in_a_sionna_scene(rt):
    from rfgen_sionna.scene.radio_materials import sionna_material

    scene = rt.load_scene(None)
    skin = sionna_material("skin", thickness=0.005)
    scene.add(skin)
    for frequency in (24e9, 77e9):
        scene.frequency = frequency
        assert float(skin.relative_permittivity[0]) == pytest.approx(
            complex(material("skin").relative_permittivity(frequency)).real, rel=1e-6
        )
    assert float(skin.thickness[0]) == pytest.approx(0.005)


@pytest.mark.parametrize(
    "pattern",
    [
        ScatteringPattern(),
        ScatteringPattern("directive", alpha_r=8),
        ScatteringPattern("backscattering", alpha_r=4, alpha_i=6, lambda_=0.3),
    ],
)
def test_a_rough_material_is_the_same_in_sionna_and_back(rt, pattern):
    from rfgen_sionna.scene.radio_materials import from_sionna, sionna_material

    rough = replace(material("concrete"), scattering_coefficient=0.5, scattering_pattern=pattern, xpd_coefficient=0.25)
    back = from_sionna(sionna_material(rough, name="rough"))
    assert (back.scattering_coefficient, back.xpd_coefficient) == (0.5, 0.25)
    assert back.scattering_pattern.kind == pattern.kind
    assert back.scattering_pattern.alpha_r == pattern.alpha_r
    assert back.scattering_pattern.alpha_i == pattern.alpha_i
    assert back.scattering_pattern.lambda_ == pytest.approx(pattern.lambda_)


def test_the_living_room_loads_in_plain_sionna(rt):
    """Without this package: ITU materials by type, ours by the constants that the file carries."""
    scene = rt.load_scene(str(resolve("scenes", "living_room")))
    for frequency in RADAR_BANDS:
        scene.frequency = frequency
    cloth = scene.radio_materials["rfgen_clothing"]
    ours = material("clothing")
    assert float(cloth.relative_permittivity[0]) == pytest.approx(complex(ours.relative_permittivity(77e9)).real)
    assert float(cloth.conductivity[0]) == pytest.approx(float(ours.conductivity(77e9)), rel=1e-3)


def test_the_living_room_is_a_room_of_real_dimensions(room):
    points = np.concatenate([item.vertices for item in room.objects])
    floor, ceiling = (next(o for o in room.objects if o.name == name) for name in ("floor", "ceiling"))
    np.testing.assert_allclose(np.ptp(floor.vertices, axis=0), [5.8, 4.4, 0], atol=1e-5)
    assert np.unique(floor.vertices[:, 2]).tolist() == [0.0]
    np.testing.assert_allclose(ceiling.vertices[:, 2], 2.6, atol=1e-6)
    assert (np.ptp(points, axis=0) < [5.9, 4.8, 2.7]).all()
    assert sum(len(o.faces) for o in room.objects) < 25_000
    assert {"sofa", "television", "bookshelf", "books", "door", "window_panes", "rug"} <= {o.name for o in room.objects}


def test_the_living_room_has_a_free_floor_and_a_free_radar(room):
    """Nothing stands within 1.2 m < x < 4.2 m, |y| < 1.2 m below the ceiling lamp."""
    for item in room.objects:
        corners = item.vertices[item.faces]
        inside = (
            (corners[..., 0].max(1) > 1.2)
            & (corners[..., 0].min(1) < 4.2)
            & (corners[..., 1].max(1) > -1.2)
            & (corners[..., 1].min(1) < 1.2)
            & (corners[..., 2].min(1) < 2.3)
        )
        assert not inside.any() or item.name == "floor", item.name
    person = MeshActor.from_mesh(
        trimesh.creation.capsule(1.2, 0.2), material="skin", position=(3, 0, 0.3), name="person"
    )
    check_radar_clear((0, 0, 1), room, [person])
    with pytest.raises(SceneError, match="sofa"):
        check_radar_clear((2.7, -1.7, 0.4), room, [person])
    with pytest.raises(SceneError, match="far_wall"):
        check_radar_clear((5.395, 1.9, 1.0), room, [person])


def test_the_living_room_shows_its_outer_side(room):
    """Seen from within, every surface shows the side its normal points to, but for the hanging curtains."""
    from rfgen_sionna.scene import face_normals

    rays = RayScene([(o.vertices, o.faces) for o in room.objects])
    normals = np.concatenate([face_normals(o.vertices, o.faces) for o in room.objects])
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    for origin in ((0, 0, 1), (3, 1, 1.7), (4.3, -1, 0.4), (1, -1.5, 2.4)):
        hits = rays.first_hit(origin, directions)
        seen = np.array([room.objects[o].name for o in hits.object])
        assert (hits.facet >= 0).all(), "the room is closed"
        front = np.einsum("ij,ij->i", normals[hits.facet], directions) < 0
        assert front[seen != "curtains"].all(), set(seen[~front])


def test_the_living_room_is_what_its_script_makes(tmp_path: Path, room):
    script = resolve("scenes", "living_room").with_name("make.py")
    spec = importlib.util.spec_from_file_location("make_living_room", script)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.build()
    module.write(tmp_path)
    again = load_scene(tmp_path / "scene.xml")
    for old, new in zip(room.objects, again.objects, strict=True):
        assert (old.name, old.material) == (new.name, new.material)
        np.testing.assert_array_equal(old.faces, new.faces)
        np.testing.assert_allclose(old.vertices, new.vertices, atol=1e-6)
    assert sum(f.stat().st_size for f in script.parent.rglob("*") if f.suffix != ".pyc") < 500_000


def test_free_space_is_empty():
    scene = load_scene(None)
    assert scene.is_free_space
    assert scene.objects == ()
    scene.tune(77e9)


def test_a_scene_that_is_a_radar_scene_already_is_returned(room):
    assert load_scene(room) is room


@pytest.mark.parametrize(
    ("scene", "error", "message"),
    [
        (
            "living_rom",
            SceneError,
            r"unknown scene 'living_rom', did you mean 'living_room'\?; allowed are box, .*munich",
        ),
        ("nowhere/scene.xml", SceneError, r"'nowhere/scene.xml' does not exist; allowed are"),
        (Path("nowhere"), SceneError, "does not exist"),
        (3, TypeError, "scene: int given"),
    ],
)
def test_what_is_no_scene_is_named_with_what_is_allowed(scene, error, message):
    with pytest.raises(error, match=message):
        load_scene(scene)


def test_files_that_are_no_scenes(tmp_path: Path):
    file = tmp_path / "a.xml"
    file.write_text("no xml")
    with pytest.raises(SceneError, match="is no XML"):
        load_scene(file)
    file.write_text("<robot/>")
    with pytest.raises(SceneError, match="its root is <robot>"):
        load_scene(file)
    file.write_text(
        '<scene version="2.1.0"><shape type="ply"><string name="filename" value="none.ply"/></shape></scene>'
    )
    with pytest.raises(SceneError, match=r"a\.xml': mesh files do not exist: .*none\.ply"):
        load_scene(file)
    file.write_text('<scene><shape type="cube"/></scene>')
    with pytest.raises(SceneError, match=r"a\.xml' cannot be loaded: .*version"):
        _ = load_scene(file, default_material="metal").objects


def test_a_material_that_sionna_has_but_not_at_its_start_frequency_loads(tmp_path: Path):
    """Sionna evaluates materials at 3.5 GHz when it loads, where floorboard is not defined."""
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.ply")
    (tmp_path / "a.xml").write_text(
        '<scene version="2.1.0"><bsdf type="itu-radio-material" id="boards"><string name="type" value="floorboard"/>'
        '<float name="thickness" value="0.02"/></bsdf><shape type="ply" id="mesh-crate">'
        '<string name="filename" value="box.ply"/><ref id="boards" name="bsdf"/></shape></scene>'
    )
    scene = load_scene(tmp_path / "a.xml", frequency=77e9)
    (crate,) = scene.objects
    assert (crate.name, crate.material, crate.properties.thickness) == ("crate", "floorboard", pytest.approx(0.02))


def test_unknown_materials_in_a_file_are_named(tmp_path: Path):
    (tmp_path / "a.xml").write_text(
        '<scene version="2.1.0"><bsdf type="radio-material" id="rfgen_granite"/>'
        '<shape type="cube"><ref id="rfgen_granite" name="bsdf"/></shape></scene>'
    )
    with pytest.raises(SceneError, match="unknown material 'granite'"):
        _ = load_scene(tmp_path / "a.xml").objects


def facing_wall(x=6.0):
    """A wall in a scene that the test keeps, and what may be loaded from it."""
    return load_scene(scene_of(77e9, wall=(wall(x), "metal", 0.01)).sionna)


def test_what_was_moved_in_the_scene_is_where_it_is_now():
    """A scene that is used again: another simulator sees objects where Sionna has them then."""
    import mitsuba as mi

    scene, radar = facing_wall(), apart()
    far = Simulator(scene, radar, [], rtol=1e-2).paths().tau.min()
    scene.sionna.objects["wall"].position = mi.Point3f(3, 0, 1)
    near = Simulator(scene, radar, [], rtol=1e-2).paths().tau.min()
    assert (far - near) * 3e8 / 2 == pytest.approx(3.0, abs=0.01)


def test_a_velocity_that_nothing_follows_is_told():
    import mitsuba as mi

    scene = facing_wall()
    scene.sionna.objects["wall"].velocity = mi.Vector3f(-10, 0, 0)
    with pytest.warns(UserWarning, match="stand still.*wall.*actors"):
        paths = Simulator(scene, apart(), [], rtol=1e-2).paths()
    assert not paths.tau_rate.any()


def test_sensing_targets_are_left_out_and_that_is_told():
    """A scene with an actor of ours as a target of Sionna's: the actor itself may be given as well."""
    scene, radar = facing_wall(), apart()
    scene.tune(radar.center_frequency)
    ball = MeshActor.from_mesh(trimesh.creation.icosphere(2, 0.1), material="pec", position=(3, 0.5, 1), name="ball")
    add_actor(scene, ball)
    with pytest.warns(UserWarning, match="sensing targets.*ball.*actors"):
        simulator = Simulator(scene, radar, [ball], rtol=1e-2)
    assert set(simulator.paths().object_names) == {"wall", "ball"}
    with pytest.raises(SceneError, match=r"GHz with sensing targets.*ball"):
        Simulator(scene, radar_of(24), [], rtol=1e-2)


def test_materials_of_actors_are_checked_before_anything_is_traced():
    """Wet ground is known to 10 GHz: a warning, or an error that names the object, the frequency and the choices."""
    puddle = trimesh.creation.box((0.1, 1.0, 1.0))

    def simulator(outside):
        made_of = material("wet_ground", outside=outside)
        return Simulator(
            None, apart(), [MeshActor.from_mesh(puddle, material=made_of, position=(3, 0, 1), name="puddle")], rtol=1e-3
        )

    with pytest.warns(MaterialRangeWarning, match="wet_ground"):
        simulator("extrapolate")
    with pytest.raises(MaterialError, match=r"puddle.*wet_ground.*7[0-9.]+ GHz.*concrete.*defined there"):
        simulator("raise")
    with pytest.raises(TypeError, match=r"puddle.*known are.*concrete"):
        Simulator(None, apart(), [MeshActor.from_mesh(puddle, material=None, position=(3, 0, 1), name="puddle")])


def test_what_is_added_to_free_space_is_there():
    """Of the scene itself, as of its Sionna scene: a wall added by hand was left out without a word."""
    scene = scene_of(77e9, wall=(wall(3.0), "pec"))
    assert not scene.is_free_space
    by_scene, by_sionna = (Simulator(each, radar_of(77), [], rtol=1e-3).paths() for each in (scene, scene.sionna))
    assert by_scene.num_paths == by_sionna.num_paths > 0


def test_a_scene_that_is_read_needs_its_file_no_more(tmp_path: Path):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.ply")
    (tmp_path / "a.xml").write_text(
        '<scene version="2.1.0"><bsdf type="diffuse" id="mat-itu_concrete"/><shape type="ply" id="mesh-crate">'
        '<string name="filename" value="box.ply"/><ref id="mat-itu_concrete" name="bsdf"/></shape></scene>'
    )
    scene = load_scene(tmp_path / "a.xml", frequency=24e9)
    assert [o.name for o in scene.objects] == ["crate"]
    (tmp_path / "a.xml").unlink()
    scene.tune(77e9)
    assert [o.name for o in scene.objects] == ["crate"]
