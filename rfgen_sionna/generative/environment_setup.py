"""Surroundings of a run: a scene file, a furnished place, or an image from a diffusion model."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument, drawn
from rfgen_sionna.generative.prompts.environment_prompt import EnvironmentPrompt
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.load import is_path, load_scene
from rfgen_sionna.scene.scene import RadarScene

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
    from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
    from rfgen_sionna.pir.fused_tracer import Refiner
    from rfgen_sionna.radar import Radar

NEEDED = ("torch", "diffusers", "safetensors")
"""Packages of the diffusion models."""
INSTALL = "pip install 'rfgen-sionna[diffusion]'"
IMAGE_FOV = 90.0
"""Default field of view of an imagined image [degrees]: most of an element's pattern; the rest has no returns."""
IMAGE_PIXELS = (64, 64)
"""Default rows and columns of an imagined image: the resolution of the model."""
_LOG = logging.getLogger(__name__)
_FILE_ONLY = "exists as a scene file only; use the source 'scene: …'"


@dataclass(frozen=True)
class RunEnvironment:
    """Surroundings of a run."""

    scene: RadarScene
    """Modelled surroundings; free space for imagined ones."""
    name: str
    """Name in run files; of a scene's file its own, without folders."""
    environment: Pir | None = None
    """Image of imagined surroundings."""
    refiner: Refiner | None = None
    """Correction of images of actors and imagined surroundings."""
    decisions: tuple[Decision, ...] = ()
    """Decisions for the report."""


@dataclass(frozen=True)
class _PathCompletion:
    """Path diffusion with one prompt."""

    model: PathDiffusion
    prompt: str
    negative: str
    seed: int
    strength: float

    def refine_sequence(self, frames: Sequence[Pir]) -> Sequence[Pir]:
        return self.model.refine_sequence(
            frames, self.prompt, negative=self.negative, strength=self.strength, seed=self.seed
        )


def missing_packages() -> tuple[str, ...]:
    """Packages of :data:`NEEDED` that are not installed, without importing any."""
    return tuple(name for name in NEEDED if find_spec(name) is None)


@dataclass(frozen=True)
class ImageOptions:
    """Options of imagined surroundings."""

    negative: str = ""
    """Negative prompt of the place."""
    refine: bool | float | None = None
    """Correction of images by path diffusion: True, False or a strength of 0 … 1; None corrects for static radars."""
    model: str | PathLike[str] | None = None
    """Environment model or Stable Diffusion base; None takes the package's own."""
    lora: str | PathLike[str] | None = None
    """RF LoRA on top of the model."""
    device: str | None = None
    """Device of the models; None takes CUDA if available."""

    @property
    def strength(self) -> float | None:
        """Strength of path diffusion; None if not given."""
        return None if self.refine is None else float(self.refine)

    def check(self, *, moves: bool) -> None:
        """Raise a ValueError if `refine` is out of range, or set for a radar that `moves`."""
        if self.refine is not None and not (isinstance(self.refine, (int, float)) and 0 <= self.refine <= 1):
            raise ValueError(f"refine is {self.refine!r}: True, False, None or a strength of 0 … 1 is needed")
        if self.refine and moves:
            raise ValueError(
                f"refine is {self.refine!r}, but the radar moves: path diffusion needs a static radar; leave it out"
            )


def chosen_source(source: str, request: EnvironmentPrompt | None, image_options: ImageOptions) -> str:
    """Source of the requested surroundings: "scene", "furnished", "diffusion", or "none".

    "auto" becomes "scene" for the name of a scene ("living_room", "Munich") and "diffusion" for a place in words.
    Without the diffusion packages a place is a scene file, if there is one, or furnished, with a warning.

    Parameters
    ----------
    source
        Source by :func:`~rfgen_sionna.generative.prompts.environment_prompt.split_source`.
    request
        Requested place; None is free space.
    image_options
        Options that only imagined surroundings take.

    Raises
    ------
    ValueError, PromptError
        If the source has no such surroundings, or an option has no effect.
    ImportError
        If packages for imagined surroundings are missing.
    """
    options = {
        "negative_environment": image_options.negative,
        "refine": image_options.refine,
        "environment_model": image_options.model,
        "environment_lora": image_options.lora,
    }
    option = next((f"{name} is {value!r}" for name, value in options.items() if value), None)
    if request is None or source == "none":
        found = "none"
        if source not in ("auto", "none"):
            raise ValueError(
                f"environment is {source!r}, but no place is named: name one ('{source}: a street'), or leave it out"
            )
    else:
        found = _automatic(request, option) if source == "auto" else source
        if found == "scene" and not request.has_file:
            raise PromptError(
                f"environment: {request.text!r} is no scene file; use the source 'furnished: …' or 'diffusion: …'"
            )
        if found in ("furnished", "diffusion") and request.place is None:
            raise PromptError(f"environment: {request.text!r} {_FILE_ONLY}")
    if found == "diffusion":
        if absent := missing_packages():
            raise ImportError(
                f"imagined surroundings need {', '.join(absent)}: {INSTALL}; or use the source 'furnished: …'"
            )
        if request is not None:
            from rfgen_sionna.generative.environment.requested_objects import check_words

            check_words(request.text, image_options.negative, ("environment", "negative_environment"))
    elif option:
        raise ValueError(f"{option}: only imagined surroundings take it, environment='diffusion: …'")
    return found


def _automatic(request: EnvironmentPrompt, option: str | None) -> str:
    """Source for "auto"; an `option` of imagined surroundings requires "diffusion" for a place."""
    if request.place is None or (request.is_name and option is None):
        return "scene"
    absent = missing_packages()
    if not absent or option is not None:
        return "diffusion"
    instead = "scene" if request.has_file else "furnished"
    _LOG.warning(
        "environment: %r needs %s to be imagined (%s); the source %r is used instead",
        request.text, ", ".join(absent), INSTALL, instead,
    )  # fmt: skip
    return instead


def set_up_environment(
    request: EnvironmentPrompt | None,
    source: str,
    radar: Radar,
    *,
    seed: int,
    image_options: ImageOptions = ImageOptions(),
    fov_deg: float | tuple[float, float] = IMAGE_FOV,
    resolution: tuple[int, int] = IMAGE_PIXELS,
    projection: str = "perspective",
) -> RunEnvironment:
    """Requested surroundings of a run.

    Parameters
    ----------
    request
        Requested place; None is free space.
    source
        Source by :func:`chosen_source`.
    radar
        The radar at its place, the viewpoint of an image.
    seed
        Seed of a layout or an image.
    image_options
        Options of imagined surroundings.
    fov_deg, resolution, projection
        Field of view [degrees], (rows, columns) and projection of an image.

    Raises
    ------
    PromptError
        If the place exists as a scene file only.
    """
    if request is None or source == "none":
        return RunEnvironment(load_scene(None), "")
    if source == "scene":
        name = Path(request.given).name if is_path(request.given) else request.scene
        return RunEnvironment(load_scene(request.given or request.scene), name)
    place = request.place
    if place is None:
        raise PromptError(f"environment: {request.text!r} {_FILE_ONLY}")
    if source == "furnished":
        room = furnished(place, seed, radar.center_frequency)
        layout = room.layout
        size = f"{layout.x[1] - layout.x[0]:.1f} x {layout.y[1] - layout.y[0]:.1f} m"
        text = f"{place} of {size} with {sum(layout.kinds.values())} pieces"
        return RunEnvironment(room, f"furnished {place}", decisions=(Decision("place", text, drawn(seed)),))
    words = f"{'an' if place[0] in 'aeiou' else 'a'} {place}" if request.text == request.scene else request.text
    view = {"fov_deg": fov_deg, "resolution": resolution, "projection": projection}
    return _imagined(words, place, radar, seed, image_options, view)


@lru_cache(maxsize=1)
def _environment_model(
    model: str | None, lora: str | None, device: str | None, _: tuple[int, ...]
) -> EnvironmentDiffusion:
    """Model, kept while the modification times of its files are the same."""
    from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion

    return EnvironmentDiffusion(model, lora, device)


@lru_cache(maxsize=1)
def _path_model(model: str | None, device: str | None, _: tuple[int, ...]) -> PathDiffusion:
    """Model, kept while the modification times of its files are the same."""
    from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion

    return PathDiffusion(model, device=device)


def _modification_times(*names: str | None) -> tuple[int, ...]:
    """Modification times of files and of the files in folders [ns]."""
    paths = [Path(name) for name in names if name is not None]
    files = [each for path in paths for each in ((path, *sorted(path.rglob("*"))) if path.is_dir() else (path,))]
    return tuple(each.stat().st_mtime_ns for each in files if each.exists())


def _with_control(model: str | None) -> str | None:
    """`model`, if it is of our format and has a ControlNet; else None, the package's own."""
    from rfgen_sionna.generative.environment.environment_model import CONTROL_FILE
    from rfgen_sionna.generative.environment.image_models import is_embedded

    if model is None or not is_embedded(Path(model)):
        return None
    path = Path(model)
    return model if (path if path.is_dir() else path.parent).joinpath(CONTROL_FILE).is_file() else None


def _imagined(
    words: str, place: str, radar: Radar, seed: int, image_options: ImageOptions, view: dict[str, Any]
) -> RunEnvironment:
    from rfgen_sionna.generative.environment.image_models import UnknownWordsWarning

    model, lora = (None if each is None else fspath(each) for each in (image_options.model, image_options.lora))
    here = radar if radar.trajectory is None else radar.at(0.0)
    view |= {"position": here.position, "orientation": here.orientation}
    diffusion = _environment_model(model, lora, image_options.device, _modification_times(model, lora))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnknownWordsWarning)  # the reader of the prompt has warned
        image = diffusion.without_cache().generate(words, negative=image_options.negative, seed=seed, **view)
    moves, strength = radar.trajectory is not None, image_options.strength
    seen = ", as seen from where the radar starts" if moves else ""
    decisions = [Decision("place", f"imagined as {words!r}{seen}", drawn(seed))]
    refiner: Any = None
    if moves:
        _LOG.warning(
            "environment: %r is imagined in one image%s: its points stay in place while radar '%s' moves, and parts "
            "outside of it stay empty%s; the source 'furnished: …' has a whole place",
            words, seen, radar.name,
            "; path diffusion, which needs a static radar, is left out" if strength is None else "",
        )  # fmt: skip
        if strength is None:
            decisions.append(Decision("paths", "not completed by path diffusion", "as the radar moves"))
    elif strength != 0:
        far, own = 1.0 if strength is None else strength, _with_control(model)
        paths = _path_model(own, image_options.device, _modification_times(own))
        refiner = _PathCompletion(paths, words, image_options.negative, seed, far)
        whose = "" if own == model else ", by the package's own model"
        how = "completed by path diffusion" + ("" if far == 1 else f", strength {far:g}") + whose
        decisions.append(Decision("paths", how, DEFAULT if strength is None else argument("refine")))
    return RunEnvironment(load_scene(None), f"imagined {place}", image, refiner, tuple(decisions))
