"""Surroundings come from files, from a seed or from a model, and what has no effect is refused."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.generative import environment_setup as setting
from rfgen_sionna.generative.environment_setup import IMAGE_PIXELS, ImageOptions, chosen_source, set_up_environment
from rfgen_sionna.generative.prompts import PromptError, parse_environment
from rfgen_sionna.generative.prompts.environment_prompt import in_words, split_source, with_source
from rfgen_sionna.scene.furnished import FurnishedScene


def kind(environment: str | None, negative: str = "", refine: bool | None = None) -> str:
    source, words = split_source(environment)
    return chosen_source(source, parse_environment(words), ImageOptions(negative, refine))


@pytest.fixture
def nothing_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setting, "missing_packages", tuple)


@pytest.fixture
def no_diffusers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setting, "missing_packages", lambda: ("diffusers",))


@pytest.mark.usefixtures("nothing_missing")
def test_a_place_in_words_is_imagined_and_a_scene_by_its_name_is_that_scene() -> None:
    assert kind("a living room") == kind("an office") == kind("a living room with a sofa", "desk") == "diffusion"
    assert kind("living_room") == kind("Munich") == "scene"
    assert kind("living_room", "sofa") == "diffusion"
    assert kind("scene: a living room") == "scene"
    assert kind("Furnished : a living room") == "furnished"
    assert kind(None) == kind("free space") == kind("none") == "none"
    words = in_words("living_room")
    assert words is not None
    assert words.text == "a living room"
    assert not words.is_name


def test_furniture_counts_where_a_place_is_imagined() -> None:
    asked = parse_environment("a living room with a sofa and a unicorn")
    assert asked is not None
    assert [sentence.split("'")[1] for sentence in asked.warnings()] == ["sofa", "unicorn"]
    assert [sentence.split("'")[1] for sentence in asked.warnings(imagined=True)] == ["unicorn"]
    for known in ("a bedroom with an office chair and a couch", "an office with a garage door", "a street with bikes"):
        asked = parse_environment(known)
        assert asked is not None
        assert asked.warnings()
        assert not asked.warnings(imagined=True)
    empty = parse_environment("an empty office")
    assert empty is not None
    assert (len(empty.warnings()), len(empty.warnings(imagined=True))) == (1, 0)
    scary = parse_environment("a bedroom with a scary cardboard-bed")  # there is a car in both
    assert scary is not None
    assert [sentence.split("'")[1] for sentence in scary.warnings(imagined=True)] == ["scary cardboard"]


@pytest.mark.usefixtures("no_diffusers")
def test_without_diffusers_there_is_an_exact_place_and_a_word_about_it(caplog: pytest.LogCaptureFixture) -> None:
    assert kind("a living room") == "scene"
    assert kind("an office") == "furnished"
    assert caplog.text.count("pip install 'rfgen-sionna[diffusion]'") == 2
    for asked in (("diffusion: an office",), ("an office", "desk"), ("an office", "", True)):
        with pytest.raises(ImportError, match=r"need diffusers: pip install 'rfgen-sionna\[diffusion\]'"):
            kind(*asked)


@pytest.mark.usefixtures("nothing_missing")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("painted: a living room",),
            r"'painted' is no source of surroundings; allowed before the colon: 'scene' \(the scene of a file\), 'furn",
        ),
        (("furnished",), r"environment is 'furnished', but no place is named: name one \('furnished: a street'\)"),
        (("scene: an office",), "'an office' is no scene file"),
        (("furnished: Munich",), "'Munich' exists as a scene file only"),
        (("diffusion: Munich",), "'Munich' exists as a scene file only"),
        (("furnished: an office", "desk"), "negative_environment is 'desk': only imagined surroundings"),
        (("scene: a living room", "", True), "refine is True: only imagined surroundings"),
        (("none: a living room",), "'none: a living room' names a place, but 'none' is free space"),
        (
            ("an office with a desk", "desks"),
            "environment: 'an office with a desk' asks for 'desk', which negative_environment 'desks' excludes",
        ),
        (("diffusion: an office", "no desk"), r"negative_environment: 'no desk' negates what is left out already"),
    ],
)
def test_what_has_no_effect_is_refused(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises((ValueError, PromptError), match=words):
        kind(*arguments)


def test_an_environment_may_name_its_source() -> None:
    assert split_source(None) == ("auto", None)
    assert split_source("an office") == ("auto", "an office")
    assert split_source("furnished: an office, with: a desk") == ("furnished", "an office, with: a desk")
    assert split_source("scene") == split_source(" scene: ") == ("scene", None)
    for words in (None, "an office"):
        for source in ("scene", "furnished", "diffusion"):
            assert split_source(with_source(words, source)) == (source, words)
        assert split_source(with_source(words, "auto")) == ("auto", words)
    with pytest.raises(
        TypeError, match="environment: expected a text, the path of a scene file, a scene, or None, got int"
    ):
        split_source(3)


def test_a_seed_furnishes(tiny_toml: Path) -> None:
    radar = rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    office, again, other = (
        set_up_environment(parse_environment("an office"), "furnished", radar, seed=s) for s in (3, 3, 4)
    )
    assert isinstance(office.scene, FurnishedScene)
    assert office.name == "furnished office"
    assert "pieces" in office.decisions[0].value
    assert office.decisions[0].value == again.decisions[0].value != other.decisions[0].value


def test_a_run_in_a_furnished_place(tiny_toml: Path, tmp_path: Path) -> None:
    pytest.importorskip("anny", reason="people need the body model")
    quick: dict[str, Any] = {"radar": tiny_toml, "duration": 0.05, "pir_resolution": (12, 16), "rtol": 0.03}
    with rfgen.generate(
        "a person stands in a corridor", environment="furnished", seed=2, output=tmp_path / "c.h5", **quick
    ) as run:
        assert run.environment == "furnished corridor"
        assert run.seeds["surroundings"] == 2
        assert "corridor of" in run.report
        assert np.isfinite(run.pir(0).time_of_arrival).mean() > 0.9


def test_a_run_in_an_imagined_place(tiny_toml: Path, tmp_path: Path) -> None:
    """Object, environment and path diffusion at work; images have the model's own pixels."""
    pytest.importorskip("anny", reason="people need the body model")
    pytest.importorskip("diffusers", reason="the models need it")
    asked: dict[str, Any] = {"environment": "a bedroom", "radar": tiny_toml}
    quick: dict[str, Any] = {"duration": 0.05, "rtol": 0.03, "seed": 2, **asked}
    with rfgen.generate("a person stands, at 2 m", output=tmp_path / "refined.h5", **quick) as run:
        assert run.environment == "imagined bedroom"
        assert "path diffusion" in run.report
        assert re.search(r"motion +auto, .* +default", run.report)
        refined = run.pir(0)
    with rfgen.generate("a person stands, at 2 m", output=tmp_path / "plain.h5", refine=False, **quick) as run:
        assert "path diffusion" not in run.report
        plain = run.pir(0)
    assert plain.energy.shape == refined.energy.shape == IMAGE_PIXELS
    assert plain.fov_deg == (90.0, 90.0)
    both = (plain.energy > 0) & (refined.energy > 0)
    change = 10 * np.log10(refined.energy[both] / plain.energy[both])
    assert 0.01 < np.sqrt(np.mean(change**2)) < 15.0
    # A pixel at an outline shows the mean of two paths, whose gains differ; no path has moved.
    moved = np.abs(refined.time_of_arrival / plain.time_of_arrival - 1)[both]
    assert (moved > 1e-3).mean() < 0.005
    assert moved.max() < 0.05
    wide: dict[str, Any] = {"pir_resolution": (32, 48), "fov_deg": (105.0, 70.0), "projection": "equirectangular"}
    wide["refine"] = False
    with rfgen.generate("a person stands", output=tmp_path / "wide.h5", **wide, **quick) as run:
        assert run.pir(0).energy.shape == (32, 48)
        assert (run.pir(0).projection, run.pir(0).fov_deg) == ("equirectangular", (105.0, 70.0))
        assert np.isfinite(run.pir(0).time_of_arrival).mean() > 0.8


def test_who_would_stand_behind_an_imagined_wall_is_told(tiny_toml: Path, tmp_path: Path) -> None:
    pytest.importorskip("anny", reason="people need the body model")
    pytest.importorskip("diffusers", reason="the models need it")
    with pytest.raises(ValueError, match="distance is 9 m: surroundings of the imagined bedroom hide the person"):
        rfgen.generate(
            "a person stands, at 9 m", environment="a bedroom", radar=tiny_toml, duration=0.05, motion="kinematic",
            refine=False, transmission=True, output=tmp_path / "hidden.h5",
        )  # fmt: skip
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    "without", [["--no-environment"], ["--environment", "scene: a living room"]], ids=lambda each: each[-1]
)
def test_what_is_not_asked_for_is_not_imported(tiny_toml: Path, tmp_path: Path, without: list[str]) -> None:
    """Rules move the person, surroundings are exact or none: nothing learned is loaded."""
    pytest.importorskip("anny", reason="people need the body model")
    code = """
import sys
from rfgen_sionna import cli
try:
    cli.main()
except SystemExit as end:
    assert not end.code, end.code
found = [n for n in sys.modules if n.split(".")[0] in ("diffusers", "transformers", "peft")
         or n.startswith("rfgen_sionna.generative") and n.split(".")[2:3] in (["environment"], ["diffusion"])]
assert not found, found
"""
    options = ["--radar", str(tiny_toml), "--duration", "0.05", "--rtol", "0.1", "--pir-resolution", "8x8"]
    options += ["--motion", "kinematic", "--no-pictures", "--output", str(tmp_path / "run.h5")]
    command = [sys.executable, "-c", code, "generate", "a person stands, in a living room, at 2 m", *options]
    done = subprocess.run([*command, *without], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with rfgen.open_run(tmp_path / "run.h5") as run:
        assert run.environment == ("" if without == ["--no-environment"] else "living_room")


@pytest.mark.slow
def test_path_diffusion_that_is_refused_is_not_imported(tiny_toml: Path) -> None:
    pytest.importorskip("diffusers", reason="the models need it")
    code = """
import sys
from rfgen_sionna.generative.environment_setup import ImageOptions, set_up_environment
from rfgen_sionna.generative.prompts.environment_prompt import parse_environment
from rfgen_sionna.radar import Radar
radar = Radar.load(sys.argv[1], position=(0, 0, 1), look_at=(3, 0, 1))
request, options = parse_environment("an office"), ImageOptions(refine=False)
made = set_up_environment(request, "diffusion", radar, seed=0, image_options=options)
assert made.environment is not None and made.refiner is None
assert "rfgen_sionna.generative.environment.environment_diffusion" in sys.modules
for name in ("path_diffusion", "confidence_gate", "classifier"):
    assert f"rfgen_sionna.generative.environment.{name}" not in sys.modules, name
"""
    done = subprocess.run([sys.executable, "-c", code, str(tiny_toml)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_models_are_read_once_and_what_they_imagined_is_not_carried_over(
    tiny_toml: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From run to run the same files stay loaded; each run's image depends on nothing that was imagined before. A
    folder with a ControlNet of its own completes with that."""
    pytest.importorskip("diffusers", reason="the models need it")
    from rfgen_sionna.generative import environment_setup as setting
    from rfgen_sionna.generative.environment import image_models as backend
    from rfgen_sionna.generative.environment.environment_model import BASE_FILE, CONTROL_FILE, read_model

    for cached in (setting._environment_model, setting._path_model):
        cached.cache_clear()
    read: list[Any] = []
    monkeypatch.setattr(backend, "read_model", lambda *args: read.append(args) or read_model(*args))
    radar = rfgen.Radar.load(str(tiny_toml), position=(0, 0, 1), look_at=(3, 0, 1))
    aside = rfgen.Radar.load(str(tiny_toml), position=(0, 0.3, 1), look_at=(3, 0, 1))
    first, asked = (
        set_up_environment(parse_environment("an office"), "diffusion", radar, seed=1),
        parse_environment("an office"),
    )
    other = set_up_environment(asked, "diffusion", aside, seed=1)
    assert len(read) == 2
    assert other.environment is not None
    assert first.environment is not None
    setting._environment_model.cache_clear()
    alone = set_up_environment(asked, "diffusion", aside, seed=1, image_options=ImageOptions(refine=False))
    assert alone.environment is not None
    np.testing.assert_array_equal(alone.environment.energy, other.environment.energy)
    assert len(read) == 3
    shipped = Path(setting.__file__).parent / "environment" / "weights"
    for name in (BASE_FILE, CONTROL_FILE):
        (tmp_path / name).symlink_to(shipped / name)
    found = set_up_environment(asked, "diffusion", radar, seed=1, image_options=ImageOptions(model=tmp_path))
    assert [args[0] for args in read[3:]] == [tmp_path, tmp_path]
    assert [each.value for each in found.decisions if each.name == "paths"] == ["completed by path diffusion"]


def test_what_is_said_of_imagining_reaches_the_models(tiny_toml: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("diffusers", reason="the models need it")
    from rfgen_sionna.generative import environment_setup as setting

    told: dict[str, Any] = {}

    class Rooms:
        def __init__(self, *args: Any) -> None:
            told["rooms"] = args

        def without_cache(self) -> Any:
            return self

        def generate(self, words: str, **options: Any) -> str:
            told["words"], told["negative"] = words, options["negative"]
            return "image"

    class Paths:
        def __init__(self, *args: Any) -> None:
            told["paths"] = args

        def refine_sequence(self, frames: Any, *_: Any, **options: Any) -> Any:
            told["strength"] = options["strength"]
            return frames

    monkeypatch.setattr(setting, "_environment_model", lambda *args: Rooms(*args[:-1]))
    monkeypatch.setattr(setting, "_path_model", lambda *args: Paths(*args[:-1]))
    radar = rfgen.Radar.load(str(tiny_toml), position=(0, 0, 1), look_at=(3, 0, 1))
    asked = parse_environment("an office with a desk")
    how = ImageOptions("sofa", 0.25, Path("model"), "owner/lora", "cpu")
    made: Any = set_up_environment(asked, "diffusion", radar, seed=0, image_options=how)
    made.refiner.refine_sequence([])
    assert told == {
        "rooms": ("model", "owner/lora", "cpu"), "words": "an office with a desk", "negative": "sofa",
        "paths": (None, "cpu"), "strength": 0.25,
    }  # fmt: skip
    assert [each.value for each in made.decisions if each.name == "paths"] == [
        "completed by path diffusion, strength 0.25, by the package's own model"
    ]
    assert set_up_environment(asked, "diffusion", radar, seed=0, image_options=ImageOptions(refine=0.0)).refiner is None


def test_a_radar_that_moves_is_told_what_it_gets(
    tiny_toml: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """One image, as seen from its start, and no path diffusion; both are in the report and in a warning."""
    pytest.importorskip("diffusers", reason="the models need it")
    from rfgen_sionna.generative import environment_setup as setting

    views: list[Any] = []

    class Rooms:
        def without_cache(self) -> Any:
            return self

        def generate(self, _: str, **options: Any) -> str:
            views.append(options["position"])
            return "image"

    monkeypatch.setattr(setting, "_environment_model", lambda *_: Rooms())
    monkeypatch.setattr(setting, "_path_model", lambda *_: pytest.fail("path diffusion was loaded"))
    radar = rfgen.Radar.load(str(tiny_toml), trajectory=lambda t: (0.3 * t, 0.5, 1))
    asked = parse_environment("an office")
    made = set_up_environment(asked, "diffusion", radar, seed=0)
    np.testing.assert_allclose(views, [(0.0, 0.5, 1.0)])
    assert made.refiner is None
    assert [(each.name, each.value) for each in made.decisions] == [
        ("place", "imagined as 'an office', as seen from where the radar starts"),
        ("paths", "not completed by path diffusion"),
    ]
    assert "while radar 'tiny' moves" in caplog.text
    assert "path diffusion, which needs a static radar, is left out" in caplog.text
    caplog.clear()
    set_up_environment(asked, "diffusion", radar, seed=0, image_options=ImageOptions(refine=False))
    assert "moves" in caplog.text
    assert "path diffusion" not in caplog.text


def test_wishes_without_effect_are_refused() -> None:
    with pytest.raises(ValueError, match="refine is True, but the radar moves"):
        ImageOptions(refine=True).check(moves=True)
    ImageOptions(refine=False).check(moves=True)
    for wrong in (1.5, -0.1, float("nan"), "yes"):
        with pytest.raises(ValueError, match=rf"refine is {wrong!r}: .* 0 … 1"):
            ImageOptions(refine=wrong).check(moves=False)  # type: ignore[arg-type]
    for how in (ImageOptions(model="folder"), ImageOptions(lora="folder"), ImageOptions(refine=0.5)):
        with pytest.raises(ValueError, match="only imagined surroundings take it"):
            chosen_source("furnished", parse_environment("an office"), how)


@pytest.fixture
def own_scene(tmp_path: Path) -> Path:
    """A floor of concrete as a Mitsuba scene."""
    floor = trimesh.Trimesh([[-5, -5, 0], [10, -5, 0], [10, 5, 0], [-5, 5, 0]], [[0, 1, 2], [0, 2, 3]])
    floor.export(tmp_path / "Floor.ply")
    shape = '<shape type="ply" id="mesh-Floor"><string name="filename" value="Floor.ply"/><ref id="mat-itu_concrete"/>'
    text = f'<bsdf type="diffuse" id="mat-itu_concrete"/>{shape}</shape>'
    (tmp_path / "own.xml").write_text(f'<scene version="2.1.0">{text}</scene>')
    return tmp_path / "own.xml"


def test_a_scene_file_is_never_read_as_words(own_scene: Path, tiny_toml: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative and absolute paths, as texts or paths, with a source or without; and scenes."""
    monkeypatch.chdir(own_scene.parent)
    radar = rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
    scene = rfgen.load_scene(own_scene)
    texts = ("own.xml", "./own.xml", str(own_scene), "scene: own.xml", f"scene: {own_scene}")
    for given in (*texts, Path("own.xml"), own_scene, scene, scene.sionna, with_source(own_scene, "scene")):
        source, what = split_source(given)
        request = parse_environment(what)
        assert request is not None
        assert chosen_source(source, request, ImageOptions()) == "scene"
        found = set_up_environment(request, "scene", radar, seed=0)
        assert [item.name for item in found.scene.objects] == ["Floor"]
        assert isinstance(found.name, str)
        assert found.name


@pytest.mark.parametrize("path", ["own/none.xml", "/none/there.glb", "scene: none.obj", Path("street"), "C:\\none.xml"])
def test_a_scene_file_that_does_not_exist_is_no_words(path: str | Path) -> None:
    with pytest.raises(FileNotFoundError, match="does not exist"):
        split_source(path)


def test_a_scene_file_has_one_source(own_scene: Path) -> None:
    with pytest.raises(PromptError, match=r"own\.xml' is a scene file, which the source 'furnished' cannot take"):
        split_source(f"furnished: {own_scene}")
    with pytest.raises(ValueError, match="refine is True: only imagined surroundings"):
        chosen_source("scene", parse_environment(own_scene), ImageOptions(refine=True))
    with pytest.raises(PromptError, match="surroundings is 'diffusion', but environment is a scene"):
        with_source(rfgen.load_scene(own_scene), "diffusion")
