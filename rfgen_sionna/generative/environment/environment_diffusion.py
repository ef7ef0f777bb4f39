"""Environment diffusion: from words to what surroundings return to a radar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING

from rfgen_sionna.generative.environment.reprojection import NATIVE, known_from_views, resize_pir
from rfgen_sionna.generative.environment.requested_objects import check_words
from rfgen_sionna.generative.prompts import check_seed
from rfgen_sionna.pir.projection import check_projection
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar.pose import Vector, vector
from rfgen_sionna.records import Pir

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.image_models import ImageModel


from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field

ENVIRONMENTS, VIEWS = 32, 16
"""Most environments, and most views of each, that are kept: 50 MB of images of 64 x 64 pixels."""


@dataclass
class _CachedEnvironment:
    first: View
    """How it was seen first, which its layout depends on; remembered as long as any view."""
    views: OrderedDict[View, Pir] = field(default_factory=OrderedDict)


class ViewCache:
    """Views by their environment; each look-up takes the same time, however many are kept.

    Parameters
    ----------
    environments, views
        Most environments, and most views of each.
    """

    def __init__(self, environments: int = ENVIRONMENTS, views: int = VIEWS) -> None:
        self._most, self._most_views = environments, views
        self._cache: OrderedDict[Hashable, _CachedEnvironment] = OrderedDict()

    def find(self, environment: Hashable, view: View) -> Pir | None:
        """The image of that view, if it is kept."""
        known = self._cache.get(environment)
        if known is None or view not in known.views:
            return None
        self._cache.move_to_end(environment)
        known.views.move_to_end(view)
        return known.views[view]

    def first(self, environment: Hashable) -> View | None:
        """How an environment was seen first; None where nothing of it is kept."""
        known = self._cache.get(environment)
        return None if known is None else known.first

    def images_of(self, environment: Hashable) -> list[Pir]:
        """All images of an environment that are kept, the most recently used last."""
        known = self._cache.get(environment)
        return [] if known is None else list(known.views.values())

    def add(self, environment: Hashable, pir: Pir) -> None:
        """Keep an image, and forget what has not been asked for longest where there is no more room."""
        view = View.of(pir)
        known = self._cache.setdefault(environment, _CachedEnvironment(view))
        known.views[view] = pir
        known.views.move_to_end(view)
        self._cache.move_to_end(environment)
        if len(known.views) > self._most_views:
            known.views.popitem(last=False)
        if len(self._cache) > self._most:
            self._cache.popitem(last=False)


_STABLE_DIFFUSION_GUIDANCE = 7.5
"""What Stable Diffusion is usually drawn with."""


class EnvironmentDiffusion:
    """Surroundings imagined from words, as a PIR in physical units.

    Parameters
    ----------
    model
        An environment model: file or folder of `training.environment.train`, a local folder or hub name of a Stable
        Diffusion base (then `lora` names an RF LoRA for it); None is the one that ships with the package.
    lora
        RF LoRA on top: a file of `training.environment.lora`, a released one, or a folder or hub name that holds one.
    device
        "cpu", "cuda", …; None takes CUDA where there is one.
    steps, guidance, sampler
        Of the drawing; few-step samplers ("dpm", "euler") are good from about 8 steps. Guidance None is 1.5, and 7.5
        with a Stable Diffusion base.
    sketched
        Whether to draw over the sketch of a furnished place of that kind (:mod:`.layout_map`), the default with our
        models; otherwise from words alone. A Stable Diffusion base reads no sketches.
    half
        Compute in half precision, which processors with bfloat16 matrix units do twice as fast; None: on CUDA alone.
    compile
        Compile the network (CUDA); pays off for many images.

    One environment is imagined once: the first view is kept under prompt, negative prompt and seed, and later views of
    it show its points from where they stand; only what it didn't show is imagined, around what is known. So many views
    are kept as :mod:`.kept` says; one that was forgotten is imagined anew, around those of its environment that are
    left.
    """

    def __init__(
        self,
        model: str | Path | None = None,
        lora: str | Path | None = None,
        device: str | None = None,
        *,
        steps: int = 20,
        guidance: float | None = None,
        sampler: str = "ddim",
        use_layout_map: bool | None = None,
        half: bool | None = None,
        compile: bool = False,
    ) -> None:
        from rfgen_sionna.generative.environment.image_models import is_embedded, load_image_model
        from rfgen_sionna.generative.environment.image_sampling import ImageSampler

        if guidance is None:
            guidance = (
                ImageSampler.guidance if model is None or is_embedded(Path(model)) else _STABLE_DIFFUSION_GUIDANCE
            )
        self.sampler = ImageSampler(sampler, steps, guidance)
        self._backend: ImageModel = load_image_model(
            model, lora, device, use_layout_map=use_layout_map, half=half, compiled=compile
        )
        self._cache = ViewCache()

    def without_cache(self) -> EnvironmentDiffusion:
        """The same model, which has imagined nothing yet."""
        other = copy(self)
        other._cache = ViewCache()
        return other

    def generate(
        self,
        prompt: str,
        *,
        negative: str = "",
        fov_deg: float | tuple[float, float] = 60.0,
        resolution: tuple[int, int] = NATIVE,
        position: Vector = (0.0, 0.0, 1.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        projection: str = "perspective",
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
    ) -> Pir:
        """What surroundings return.

        Energy is |path gain|^2 for isotropic elements, time of arrival NaN where nothing returns, velocity 0. The floor
        is z = 0.

        Parameters
        ----------
        prompt, negative
            What the surroundings are ("a living room with a sofa"), and what isn't there.
        fov_deg
            Horizontal field of view [degrees] with square pixels, or (horizontal, vertical).
        resolution
            (rows, columns).
        position, orientation
            Viewpoint [m] and its yaw, pitch, roll [rad].
        projection
            "perspective", or "equirectangular" (azimuth and elevation evenly).
        seed
            The same prompt, views and seed give the same images; later views depend on those that were asked for
            before them.
        progress
            Called with (step, steps).

        Raises
        ------
        ValueError
            If an argument is out of its range, or a later view stands outside of the room of the first.
        PromptError
            If the words can't be meant so (:func:`~rfgen_sionna.generative.environment.requested_objects.check_words`).
        DeviceMemoryError
            If the device's memory doesn't suffice.
        """
        (rows, columns), view = _view(resolution, fov_deg, position, orientation, projection)
        self._check(prompt, negative, view)
        check_seed(seed)
        environment = prompt, negative, int(seed), self.sampler
        pir = self._cache.find(environment, view)
        if pir is None:
            images_of = self._cache.images_of(environment)
            known = known_from_views(images_of, view) if images_of else None
            first = self._cache.first(environment)
            (pir,) = self._backend.draw([prompt], negative, view, self.sampler, [int(seed)], known, first, progress)
            for channel in (pir.energy, pir.time_of_arrival, pir.velocity):
                channel.flags.writeable = False  # it is what the next view is drawn around
            self._cache.add(environment, pir)
        return resize_pir(pir, (rows, columns))

    def generate_many(
        self,
        prompts: Sequence[str],
        *,
        seeds: Sequence[int],
        negative: str = "",
        fov_deg: float | tuple[float, float] = 60.0,
        resolution: tuple[int, int] = NATIVE,
        position: Vector = (0.0, 0.0, 1.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        projection: str = "perspective",
        batch: int = 16,
        progress: Callable[[int, int], None] | None = None,
    ) -> list[Pir]:
        """Many surroundings of one view, drawn `batch` at a time, which costs less for each; none is kept.

        The arguments are those of :meth:`generate`, with a seed for each prompt; `progress` is called with
        (drawn, to be drawn).
        """
        if isinstance(prompts, str):
            raise TypeError(f"prompts is {prompts!r}: a list of prompts is needed, one for each seed")
        if len(prompts) != len(seeds):
            raise ValueError(
                f"seeds: {len(seeds)} for {len(prompts)} prompts, {batch} at a time; one for each is needed"
            )
        (rows, columns), view = _view(resolution, fov_deg, position, orientation, projection)
        for prompt, seed in zip(prompts, seeds, strict=True):
            self._check(prompt, negative, view)
            check_seed(seed)
        out: list[Pir] = []
        for start in range(0, len(prompts), max(1, batch)):
            part = slice(start, start + max(1, batch))
            some = [int(seed) for seed in seeds[part]]
            drawn = self._backend.draw(prompts[part], negative, view, self.sampler, some, None, None, None)
            out += [resize_pir(pir, (rows, columns)) for pir in drawn]
            if progress is not None:
                progress(len(out), len(prompts))
        return out

    def _check(self, prompt: str, negative: str, view: View) -> None:
        check_words(prompt, negative)
        if not view.position[2] > 0:
            raise ValueError(f"position: {view.position[2]:g} m high, and the floor is z = 0; above it is needed")
        self._backend.check_view(view)


def _view(
    resolution: tuple[int, int],
    fov_deg: float | tuple[float, float],
    position: Vector,
    orientation: Vector,
    projection: str,
) -> tuple[tuple[int, int], View]:
    """The resolution that is asked for, and the view with the pixels that are drawn."""
    shape = check_projection(projection)
    rows, columns, fov = check_view(resolution, fov_deg, shape)
    return (rows, columns), View(NATIVE, fov, vector("position", position), vector("orientation", orientation), shape)
