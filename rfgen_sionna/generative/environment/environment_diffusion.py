"""Environment diffusion: from words to a PIR of surroundings, and a cache of views."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from rfgen_sionna.generative.environment.reprojection import NATIVE, known_from_views, resize_pir
from rfgen_sionna.generative.environment.requested_objects import check_words
from rfgen_sionna.generative.prompts.scene_prompt import check_seed
from rfgen_sionna.pir.projection import check_projection
from rfgen_sionna.pir.render import check_view
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar.pose import Vector, vector
from rfgen_sionna.records import Pir

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.image_models import ImageModel

ENVIRONMENTS, VIEWS = 32, 16
"""Cached environments, and views of each; bounds memory to 50 MB of 64 × 64 images."""
_STABLE_DIFFUSION_GUIDANCE = 7.5
"""Usual guidance of Stable Diffusion."""


@dataclass
class _CachedEnvironment:
    first: View
    """First view, which decides the layout."""
    views: OrderedDict[View, Pir] = field(default_factory=OrderedDict)


class ViewCache:
    """Cache of views by environment, at most `environments` with `views` each; the least recently used are evicted
    first."""

    def __init__(self, environments: int = ENVIRONMENTS, views: int = VIEWS) -> None:
        self._most, self._most_views = environments, views
        self._cache: OrderedDict[Hashable, _CachedEnvironment] = OrderedDict()

    def find(self, environment: Hashable, view: View) -> Pir | None:
        """Cached image of a view; None for a miss."""
        known = self._cache.get(environment)
        if known is None or view not in known.views:
            return None
        self._cache.move_to_end(environment)
        known.views.move_to_end(view)
        return known.views[view]

    def first(self, environment: Hashable) -> View | None:
        """First view of an environment; None for a miss."""
        known = self._cache.get(environment)
        return None if known is None else known.first

    def images_of(self, environment: Hashable) -> list[Pir]:
        """All cached images of an environment, the most recently used last."""
        known = self._cache.get(environment)
        return [] if known is None else list(known.views.values())

    def add(self, environment: Hashable, pir: Pir) -> None:
        """Cache an image, and evict the least recently used ones beyond the limits."""
        view = View.of(pir)
        known = self._cache.setdefault(environment, _CachedEnvironment(view))
        known.views[view] = pir
        known.views.move_to_end(view)
        self._cache.move_to_end(environment)
        if len(known.views) > self._most_views:
            known.views.popitem(last=False)
        if len(self._cache) > self._most:
            self._cache.popitem(last=False)


class EnvironmentDiffusion:
    """Surroundings imagined from words, as a PIR in physical units.

    The first view of an environment is cached under prompt, negative prompt and seed. Later views reproject it and draw
    only the unseen parts (:class:`ViewCache`).

    Parameters
    ----------
    model
        An environment model: file or folder of `training.environment.train`, a local folder or hub name of a Stable
            Diffusion base (then `lora` names its RF LoRA). None takes the shipped model.
    lora
        RF LoRA: a file of `training.environment.lora`, a released one, or a folder or hub name with one. None adds
            none.
    device
        "cpu", "cuda", …; None takes CUDA where available.
    steps, guidance, sampler
        Of the drawing; few-step samplers ("dpm", "euler") need about 8 steps. Guidance None takes 1.5, and 7.5 for a
        Stable Diffusion base.
    use_layout_map
        Whether to draw over the layout map of a furnished place (:mod:`.layout_map`), or from words alone. None uses
        layout maps with the embedded model; a Stable Diffusion base has none.
    half
        Whether to compute in half precision, twice as fast on processors with bfloat16 matrix units. None does on CUDA
        only.
    compile
        Whether to compile the network (CUDA); pays off for many images.

    Raises
    ------
    ValueError
        If an argument is out of its range, or there is no such device.
    FileNotFoundError, ModelFileError, ModelError, LoraError
        If model or LoRA are missing or unreadable, or do not fit.
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
        """The same model with an empty cache."""
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
        """PIR of surroundings.

        Energy is |path gain|² for isotropic elements; time of arrival is NaN for empty pixels, velocity 0. The floor is
        z = 0.

        Parameters
        ----------
        prompt, negative
            Description of the surroundings ("a living room with a sofa"), and absent objects.
        fov_deg
            Horizontal field of view [degrees] with square pixels, or (horizontal, vertical).
        resolution
            (rows, columns).
        position, orientation
            Viewpoint [m] and its yaw, pitch, roll [rad].
        projection
            "perspective", or "equirectangular" (even steps of azimuth and elevation).
        seed
            Of all random choices. Later views of an environment depend on the earlier ones.
        progress
            Called with (step, steps); None reports nothing.

        Raises
        ------
        ValueError
            If an argument is out of its range, or a later view is outside the room of the first.
        PromptError
            If the words contradict each other
            (:func:`~rfgen_sionna.generative.environment.requested_objects.check_words`).
        DeviceMemoryError
            If the device runs out of memory.
        """
        from rfgen_sionna.generative.environment.image_sampling import DrawingOptions

        (rows, columns), view = _view(resolution, fov_deg, position, orientation, projection)
        self._check(prompt, negative, view)
        check_seed(seed)
        environment = prompt, negative, int(seed), self.sampler
        pir = self._cache.find(environment, view)
        if pir is None:
            images_of = self._cache.images_of(environment)
            known = known_from_views(images_of, view) if images_of else None
            first = self._cache.first(environment)
            options = DrawingOptions(view, self.sampler, negative, known, first, progress)
            (pir,) = self._backend.draw([prompt], [int(seed)], options)
            for channel in (pir.energy, pir.time_of_arrival, pir.velocity):
                channel.flags.writeable = False  # cached
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
        """PIRs of many surroundings for one view, `batch` at a time, which costs less for each; none is cached.

        Arguments as in :meth:`generate`, with a seed for each prompt; `progress` is called with (drawn, total).

        Raises
        ------
        TypeError
            If `prompts` is a string.
        """
        from rfgen_sionna.generative.environment.image_sampling import DrawingOptions

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
            drawn = self._backend.draw(prompts[part], some, DrawingOptions(view, self.sampler, negative))
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
    """The requested resolution, and the view with the model's pixels."""
    shape = check_projection(projection)
    rows, columns, fov = check_view(resolution, fov_deg, shape)
    return (rows, columns), View(NATIVE, fov, vector("position", position), vector("orientation", orientation), shape)
