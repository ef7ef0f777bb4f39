"""Synthetic radar data of people in rooms, from a sentence to ADC cubes, on Sionna RT.

Public names are loaded at first use: an import of the package imports neither Mitsuba nor torch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.dataset import open_dataset as open_dataset
    from rfgen_sionna.dataset import open_run as open_run
    from rfgen_sionna.generative.actor import Actor as Actor
    from rfgen_sionna.generative.several_actors import actors_from_prompt as actors_from_prompt
    from rfgen_sionna.generative.things.thing_catalogue import things as things
    from rfgen_sionna.pipeline import generate as generate
    from rfgen_sionna.radar import Radar as Radar
    from rfgen_sionna.recipes.building import build_dataset as build_dataset
    from rfgen_sionna.recipes.planning import plan_dataset as plan_dataset
    from rfgen_sionna.recipes.recipe import Recipe as Recipe
    from rfgen_sionna.recording import record as record
    from rfgen_sionna.records import AdcCube as AdcCube
    from rfgen_sionna.records import MeshSequence as MeshSequence
    from rfgen_sionna.records import Motion as Motion
    from rfgen_sionna.records import PathKind as PathKind
    from rfgen_sionna.records import Pir as Pir
    from rfgen_sionna.records import RadarPaths as RadarPaths
    from rfgen_sionna.resynthesis import resynthesize as resynthesize
    from rfgen_sionna.scene import Material as Material
    from rfgen_sionna.scene import load_scene as load_scene
    from rfgen_sionna.scene import material as material
    from rfgen_sionna.scene.furnished import furnished as furnished
    from rfgen_sionna.simulation import Simulator as Simulator
    from rfgen_sionna.tracing.radar_cross_section import rcs as rcs
    from rfgen_sionna.tracing.sionna.sensing_target import add_actor as add_actor
    from rfgen_sionna.tracing.sionna.sionna_paths import from_sionna as from_sionna

    __version__: str

_HOMES = {
    "Actor": "generative.actor",
    "AdcCube": "records",
    "Material": "scene",
    "MeshSequence": "records",
    "Motion": "records",
    "PathKind": "records",
    "Pir": "records",
    "Radar": "radar",
    "RadarPaths": "records",
    "Recipe": "recipes.recipe",
    "Simulator": "simulation",
    "actors_from_prompt": "generative.several_actors",
    "add_actor": "tracing.sionna.sensing_target",
    "build_dataset": "recipes.building",
    "from_sionna": "tracing.sionna.sionna_paths",
    "furnished": "scene.furnished",
    "generate": "pipeline",
    "load_scene": "scene",
    "material": "scene",
    "open_dataset": "dataset",
    "open_run": "dataset",
    "plan_dataset": "recipes.planning",
    "rcs": "tracing.radar_cross_section",
    "record": "recording",
    "resynthesize": "resynthesis",
    "things": "generative.things.thing_catalogue",
}
"""Public name -> module that defines it."""

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            value: Any = version("rfgen-sionna")
        except PackageNotFoundError:  # a bare tree on sys.path
            value = "0+unknown"
    elif name in _HOMES:
        from importlib import import_module

        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
