"""What surrounds the actors of a run: a scene of a file, a furnished place, or an image that a model draws."""

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

from rfgen_sionna.generative.body_prompt import PromptError
from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument, drawn
from rfgen_sionna.generative.environment_prompt import EnvironmentPrompt
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.load import load_scene
from rfgen_sionna.scene.scene import RadarScene

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
    from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
    from rfgen_sionna.pir.fused_tracer import Refiner
    from rfgen_sionna.radar import Radar

NEEDED = ("torch", "diffusers", "safetensors")
"""Packages that imagine surroundings."""
INSTALL = "pip install 'rfgen-sionna[diffusion]'"
IMAGE_FOV = 90.0
"""Field of view [degrees] of an imagined image: what lies outside of it returns nothing."""
IMAGE_PIXELS = (64, 64)
"""Rows and columns that an imagined image is drawn in."""
_LOG = logging.getLogger(__name__)
_FILE_ALONE = "is a scene of a file alone; the source 'scene: …' has it"


@dataclass(frozen=True)
class RunEnvironment:
    """The surroundings of a run."""

    scene: RadarScene
    """Modelled surroundings; free space where they are imagined."""
    name: str
    """What files call them."""
    environment: Pir | None = None
    """Imagined surroundings."""
    refiner: Refiner | None = None
    decisions: tuple[Decision, ...] = ()


@dataclass(frozen=True)
class _PathCompletion:
    """Path diffusion of one prompt."""

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
    """Packages that imagining surroundings needs and that aren't installed; nothing is imported."""
    return tuple(name for name in NEEDED if find_spec(name) is None)


@dataclass(frozen=True)
class ImageOptions:
    """How surroundings are imagined, where they are."""

    negative: str = ""
    """What the place is without."""
    refine: bool | float | None = None
    """Whether path diffusion completes images of actors and surroundings, or with what strength, 0 … 1; None does
    unless the radar moves."""
    model: str | PathLike[str] | None = None
    """Environment model or Stable Diffusion base; None is the one that ships with the package."""
    lora: str | PathLike[str] | None = None
    """RF LoRA on top."""
    device: str | None = None
    """Where to compute; None is CUDA where there is one."""

    @property
    def strength(self) -> float | None:
        """That of path diffusion; None where nothing was said."""
        return None if self.refine is None else float(self.refine)

    def check(self, *, moves: bool) -> None:
        """Raises ValueError where what is said is out of its range, or the radar `moves` and refinement is wanted."""
        if self.refine is not None and not (isinstance(self.refine, (int, float)) and 0 <= self.refine <= 1):
            raise ValueError(f"refine is {self.refine!r}: True, False, None or a strength of 0 … 1 is needed")
        if self.refine and moves:
            raise ValueError(
                f"refine is {self.refine!r}, but the radar moves: images are completed for one that stands"
            )


def chosen_source(source: str, asked: EnvironmentPrompt | None, image_options: ImageOptions) -> str:
    """Source of the surroundings that are `asked` for: "scene", "furnished", "diffusion", or "none".

    `source` is that of :func:`~rfgen_sionna.generative.environment_prompt.split_source`. "auto" becomes "diffusion"
    for a place in words. A scene by its own name ("living_room", "Munich") is that scene. Without the packages that
    draw images, a place is the scene of a file where there is one, else furnished, with a warning.

    Raises
    ------
    ValueError, PromptError
        The source has no such surroundings, or an argument would have no effect.
    ImportError
        Surroundings are to be imagined, and packages are missing.
    """
    wishes = {
        "negative_environment": image_options.negative,
        "refine": image_options.refine,
        "environment_model": image_options.model,
        "environment_lora": image_options.lora,
    }
    requested = next((f"{name} is {value!r}" for name, value in wishes.items() if value), None)
    if asked is None or source == "none":
        found = "none"
        if source not in ("auto", "none"):
            raise ValueError(
                f"environment is {source!r}, but no place is named: name one ('{source}: a street'), or leave it out"
            )
    else:
        found = _automatic(asked, must=requested) if source == "auto" else source
        if found == "scene" and not asked.has_file:
            raise PromptError(
                f"environment: {asked.text!r} is no scene of a file; the sources 'furnished: …' and 'diffusion: …' "
                "have it"
            )
        if found in ("furnished", "diffusion") and asked.place is None:
            raise PromptError(f"environment: {asked.text!r} {_FILE_ALONE}")
    if found == "diffusion":
        if absent := missing_packages():
            raise ImportError(
                f"imagined surroundings need {', '.join(absent)}: {INSTALL}; or take the source 'furnished: …'"
            )
        if asked is not None:
            from rfgen_sionna.generative.environment.requested_objects import check_words

            check_words(asked.text, image_options.negative, ("environment", "negative_environment"))
    elif requested:
        raise ValueError(f"{requested}: only imagined surroundings take it, environment='diffusion: …'")
    return found


def _automatic(asked: EnvironmentPrompt, must: str | None) -> str:
    """What "auto" stands for; a wish that only imagined surroundings fulfil leaves no other."""
    if asked.place is None or (asked.is_name and must is None):
        return "scene"
    absent = missing_packages()
    if not absent or must is not None:
        return "diffusion"
    instead = "scene" if asked.has_file else "furnished"
    _LOG.warning(
        "environment: %r would be imagined by a model, which needs %s (%s); the source %r is taken instead",
        asked.text, ", ".join(absent), INSTALL, instead,
    )  # fmt: skip
    return instead


def set_up_environment(
    asked: EnvironmentPrompt | None,
    source: str,
    radar: Radar,
    *,
    seed: int,
    image_options: ImageOptions = ImageOptions(),
    fov_deg: float | tuple[float, float] = IMAGE_FOV,
    resolution: tuple[int, int] = IMAGE_PIXELS,
    projection: str = "perspective",
) -> RunEnvironment:
    """The surroundings that are asked for; `source` is that of :func:`chosen_source`.

    Parameters
    ----------
    asked
        What the words name; None is free space.
    radar
        Placed; an image is drawn as it sees it.
    seed
        Of the layout, or of the drawing.
    imagining
        How a place is imagined.
    fov_deg, resolution, projection
        Field of view, (rows, columns) and projection of an imagined image.
    """
    if asked is None or source == "none":
        return RunEnvironment(load_scene(None), "")
    if source == "scene":
        return RunEnvironment(load_scene(asked.scene), asked.scene)
    place = asked.place
    if place is None:
        raise PromptError(f"environment: {asked.text!r} {_FILE_ALONE}")
    if source == "furnished":
        room = furnished(place, seed, radar.center_frequency)
        layout = room.layout
        size = f"{layout.x[1] - layout.x[0]:.1f} x {layout.y[1] - layout.y[0]:.1f} m"
        what = f"{place} of {size} with {sum(layout.kinds.values())} pieces"
        return RunEnvironment(room, f"furnished {place}", decisions=(Decision("place", what, drawn(seed)),))
    return _generated(
        asked,
        place,
        radar,
        seed=seed,
        image_options=image_options,
        fov_deg=fov_deg,
        resolution=resolution,
        projection=projection,
    )


@lru_cache(maxsize=1)
def _environment_model(
    model: str | None, lora: str | None, device: str | None, _: tuple[int, ...]
) -> EnvironmentDiffusion:
    """Kept from run to run, as long as its files stay the same."""
    from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion

    return EnvironmentDiffusion(model, lora, device)


@lru_cache(maxsize=1)
def _path_model(model: str | None, device: str | None, _: tuple[int, ...]) -> PathDiffusion:
    """Kept from run to run, as long as its files stay the same."""
    from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion

    return PathDiffusion(model, device=device)


def _modification_times(*names: str | None) -> tuple[int, ...]:
    """When the files of that name, or in the folders of that name, were last written [ns]."""
    paths = [Path(name) for name in names if name is not None]
    files = [each for path in paths for each in ((path, *sorted(path.rglob("*"))) if path.is_dir() else (path,))]
    return tuple(each.stat().st_mtime_ns for each in files if each.exists())


def _with_control(model: str | None) -> str | None:
    """The model, if it is one of ours with a ControlNet beside it; else the one that ships."""
    from rfgen_sionna.generative.environment.environment_model import CONTROL_FILE
    from rfgen_sionna.generative.environment.image_models import is_embedded

    if model is None or not is_embedded(Path(model)):
        return None
    path = Path(model)
    return model if (path if path.is_dir() else path.parent).joinpath(CONTROL_FILE).is_file() else None


def _generated(
    asked: EnvironmentPrompt,
    place: str,
    radar: Radar,
    *,
    seed: int,
    image_options: ImageOptions,
    fov_deg: float | tuple[float, float],
    resolution: tuple[int, int],
    projection: str,
) -> RunEnvironment:
    from rfgen_sionna.generative.environment.image_models import UnknownWordsWarning

    model, lora = (None if each is None else fspath(each) for each in (image_options.model, image_options.lora))
    here = radar if radar.trajectory is None else radar.at(0.0)
    words = f"{'an' if place[0] in 'aeiou' else 'a'} {place}" if asked.text == asked.scene else asked.text
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnknownWordsWarning)  # the reader of the whole prompt has said it
        image = (
            _environment_model(model, lora, image_options.device, _modification_times(model, lora))
            .without_cache()
            .generate(
                words,
                negative=image_options.negative,
                fov_deg=fov_deg,
                resolution=resolution,
                projection=projection,
                position=here.position,
                orientation=here.orientation,
                seed=seed,
            )
        )
    moves, strength = radar.trajectory is not None, image_options.strength
    seen = ", as seen from where the radar starts" if moves else ""
    decisions = [Decision("place", f"imagined as {words!r}{seen}", drawn(seed))]
    refiner: Any = None
    if moves:
        _LOG.warning(
            "environment: %r is imagined in one image%s: its points stay in place while radar '%s' moves, and what "
            "comes into view later is not there%s; the source 'furnished: …' has all of a place along the way",
            words, seen, radar.name,
            "; path diffusion, which completes images for a radar that stands, is left out" if strength is None else "",
        )  # fmt: skip
        if strength is None:
            decisions.append(Decision("paths", "not completed by path diffusion", "as the radar moves"))
    elif strength != 0:
        far, own = 1.0 if strength is None else strength, _with_control(model)
        paths = _path_model(own, image_options.device, _modification_times(own))
        refiner = _PathCompletion(paths, words, image_options.negative, seed, far)
        whose = "" if own == model else ", that of the model that ships with the package"
        how = "completed by path diffusion" + ("" if far == 1 else f", strength {far:g}") + whose
        decisions.append(Decision("paths", how, DEFAULT if strength is None else argument("refine")))
    return RunEnvironment(load_scene(None), f"imagined {place}", image, refiner, tuple(decisions))
