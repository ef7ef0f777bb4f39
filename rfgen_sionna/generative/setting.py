"""What surrounds the actors of a run: a scene of a file, a furnished place, or an image that a model draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rfgen_sionna.generative.body_prompt import PromptError
from rfgen_sionna.generative.decisions import DEFAULT, Decision, argument, drawn
from rfgen_sionna.generative.surroundings import EnvironmentPrompt
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.load import RadarScene, load_scene

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.refine import PathDiffusion
    from rfgen_sionna.pir.fused import Refiner
    from rfgen_sionna.radar import Radar

KINDS = ("auto", "scene", "furnished", "diffusion")
IMAGE_FOV = 90.0
"""Field of view [degrees] of an imagined image: what lies outside of it returns nothing."""
IMAGE_PIXELS = (64, 64)
"""Rows and columns of an imagined image."""
STRENGTH = 1.0
"""How far path diffusion goes from the image that is traced and imagined."""
_FILE_ALONE = "is a scene of a file alone; surroundings='scene' has it"


@dataclass(frozen=True)
class Setting:
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
class _Repair:
    """Path diffusion of one prompt."""

    model: PathDiffusion
    prompt: str
    negative: str
    seed: int

    def refine_sequence(self, frames: Sequence[Pir]) -> Sequence[Pir]:
        return self.model.refine_sequence(
            frames, self.prompt, negative=self.negative, strength=STRENGTH, seed=self.seed
        )


def check_kind(kind: str, asked: EnvironmentPrompt | None, *, negative: str, refine: bool | None) -> str:
    """Where surroundings come from: "scene", "furnished", "diffusion", or "none" where there are none.

    Raises
    ------
    ValueError, PromptError
        If `kind` is none of :data:`KINDS`, there are no such surroundings of it, or an argument would have no effect.
    """
    if kind not in KINDS:
        raise ValueError(f"surroundings is {kind!r}; allowed are {', '.join(map(repr, KINDS))}")
    if asked is None:
        found = "none"
        if kind != "auto":
            raise ValueError(f"surroundings is {kind!r}, but no environment is named; leave it out for free space")
    else:
        found = ("scene" if asked.has_file else "furnished") if kind == "auto" else kind
        if found == "scene" and not asked.has_file:
            raise PromptError(
                f"environment: {asked.text!r} is no scene of a file; surroundings='furnished' or 'diffusion' has it"
            )
        if found in ("furnished", "diffusion") and asked.place is None:
            raise PromptError(f"environment: {asked.text!r} {_FILE_ALONE}")
    if found != "diffusion":
        for name, value in (("negative_environment", negative), ("refine", refine)):
            if value:
                raise ValueError(f"{name} is {value!r}: only imagined surroundings take it, surroundings='diffusion'")
    return found


def set_up(
    asked: EnvironmentPrompt | None,
    kind: str,
    radar: Radar,
    *,
    seed: int,
    negative: str = "",
    refine: bool | None = None,
    fov_deg: float | tuple[float, float] = IMAGE_FOV,
) -> Setting:
    """The surroundings that are asked for; `kind` is that of :func:`check_kind`.

    Parameters
    ----------
    asked
        What the words name; None is free space.
    radar
        Placed; an image is drawn as it sees it.
    seed
        Of the layout, or of the drawing.
    negative
        What an imagined place is without.
    refine
        Whether path diffusion completes images of actors and surroundings; None does unless the radar moves.
    fov_deg
        Field of view of an imagined image.
    """
    if asked is None or kind == "none":
        return Setting(load_scene(None), "")
    if kind == "scene":
        return Setting(load_scene(asked.scene), asked.scene)
    place = asked.place
    if place is None:
        raise PromptError(f"environment: {asked.text!r} {_FILE_ALONE}")
    if kind == "furnished":
        room = furnished(place, seed, radar.center_frequency)
        layout = room.layout
        size = f"{layout.x[1] - layout.x[0]:.1f} x {layout.y[1] - layout.y[0]:.1f} m"
        what = f"{place} of {size} with {sum(layout.kinds.values())} pieces"
        return Setting(room, f"furnished {place}", decisions=(Decision("place", what, drawn(seed)),))
    return _imagined(asked, place, radar, seed=seed, negative=negative, refine=refine, fov_deg=fov_deg)


def _imagined(
    asked: EnvironmentPrompt,
    place: str,
    radar: Radar,
    *,
    seed: int,
    negative: str,
    refine: bool | None,
    fov_deg: float | tuple[float, float],
) -> Setting:
    from rfgen_sionna.generative.environment.diffusion import EnvironmentDiffusion

    here = radar if radar.trajectory is None else radar.at(0.0)
    words = asked.text if asked.text != asked.scene else f"a {place}"
    image = EnvironmentDiffusion().generate(
        words,
        negative=negative,
        fov_deg=fov_deg,
        resolution=IMAGE_PIXELS,
        position=here.position,
        orientation=here.orientation,
        seed=seed,
    )
    decisions = [Decision("place", f"imagined as {words!r}", drawn(seed))]
    refiner: Any = None
    if radar.trajectory is None and refine is not False:
        from rfgen_sionna.generative.environment.refine import PathDiffusion

        refiner = _Repair(PathDiffusion(), words, negative, seed)
        decisions.append(Decision("paths", "completed by path diffusion", argument("refine") if refine else DEFAULT))
    return Setting(load_scene(None), f"imagined {place}", image, refiner, tuple(decisions))
