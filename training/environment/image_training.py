"""Training of the base image model: seeded, resumable, on one machine."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from diffusers.models.attention_processor import AttnProcessor
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import fingerprint
from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.conditional_prior import ConditionalPrior
from rfgen_sionna.generative.environment.environment_model import BASE_FILE, EnvironmentModel, UNetShape
from rfgen_sionna.generative.environment.layout_map import NO_LAYOUT_MAP
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder
from rfgen_sionna.generative.environment.view_unet import KINDS, make_scheduler, signal_and_noise
from rfgen_sionna.pir.codec import PirCodec
from training.environment.fits import brightness_offsets, fit_conditional_prior
from training.environment.view_corpus import ViewCorpus
from training.learning import Progress, Run, precision, reports_out_of_memory
from training.model_files import write_environment_model

WITHOUT_FILE = "without-later.safetensors"
"""The model before it was shown its recipe's later place."""
_SILENT = 0.12
"""Share of the images shown without a sentence, so that guidance has something to guide away from."""

_UNSKETCHED = 0.2
"""Share of the images shown without a sketch: places are also drawn from words alone, and refined without one."""
_HIGH_NOISE = 1.5
"""Times are drawn as 1 − u to this power: what stands where is decided under much noise, since patches that belong
together tell of each other."""


@dataclass(frozen=True)
class ImageRecipe:
    """What decides the outcome of a training run."""

    steps: int = 12_000
    items: int = 32
    """Images a step."""
    rate: float = 6e-4
    """Learning rate; it warms up over 300 steps and falls over the last 40 % of them."""
    seed: int = 0
    average: float = 0.9985
    """Decay of the running mean of the weights, which is what is kept."""
    later: str = ""
    """A place that isn't shown before step `later_from`; the model of that moment is kept too, so that an RF LoRA can
    be examined on a place that its base has never seen."""
    later_from: int = 0
    begun: str = ""
    """Fingerprint of the network that training begins with; :func:`train` fills it in."""


@dataclass(frozen=True)
class ViewBatch:
    """What one step sees."""

    index: list[int]
    """(item,) of the corpus."""
    mirrored: list[bool]
    tokens: Tensor
    """(item, TOKENS, WIDTH)."""


def draw_batch(
    corpus: ViewCorpus,
    text: PlaceEncoder,
    items: int,
    rng: np.random.Generator,
    silent: float = _SILENT,
    without: str = "",
) -> ViewBatch:
    """Items drawn evenly over the places but `without`, newly worded, half of them mirrored."""
    groups = [np.flatnonzero(corpus.places == k) for k in np.unique(corpus.places) if corpus.names[k] != without]
    index = [int(rng.choice(groups[int(rng.integers(len(groups)))])) for _ in range(items)]
    mirrored = [bool(rng.integers(2)) for _ in index]
    texts = ["" if rng.uniform() < silent else corpus.sentence(i, rng) for i in index]
    return ViewBatch(
        index, mirrored, text.embed(texts, [corpus.view(i, m) for i, m in zip(index, mirrored, strict=True)])
    )


@reports_out_of_memory
def train(
    corpus: ViewCorpus,
    vae: PatchAutoencoder,
    text: PlaceEncoder,
    out: Path,
    recipe: ImageRecipe,
    *,
    shape: UNetShape | None = None,
    codec: PirCodec | None = None,
    start: EnvironmentModel | None = None,
    device: str = "cpu",
    compiled: bool = False,
    save_every: int = 200,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `environment.safetensors` there.

    Args:
        corpus: the training set, with sketches.
        vae, text: autoencoder and sentence encoder; they aren't changed.
        out: folder of checkpoint, log and result.
        recipe: what to do. A checkpoint of another recipe is refused, except for more or fewer steps.
        shape: sizes of the network.
        codec: the convention of the images, which the model will carry.
        start: a trained model to begin with, of which `vae`, `text`, `shape` and `codec` are; None: random weights.
        device: where to train.
        compiled: compile the network: a third quicker on a CPU, and needs a C++ compiler.
        save_every: steps between checkpoints.
        progress: called with (step, steps, running mean of the loss).

    Returns:
        the file with the model.

    Raises:
        ValueError: `out` holds a checkpoint of another recipe or start, or its later place isn't in the corpus.
    """
    if recipe.later and recipe.later not in corpus.names:
        raise ValueError(f"later: {recipe.later!r}; the data set has {', '.join(corpus.names)}")
    recipe = replace(recipe, begun=fingerprint(None if start is None else start.unet))
    shape, codec = shape or UNetShape(latents=vae.config.latent_channels), codec or PirCodec()
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    net = shape.unet()
    if start is not None:
        net.load_state_dict(start.unet.state_dict())
    run = Run(net.to(device), recipe, out / "checkpoint.pt", out / "log.jsonl")
    if device == "cpu":
        run.net.set_attn_processor(AttnProcessor())  # the fused kernel's backward pass is slow there
        torch.nn.Module.to(run.net, memory_format=torch.channels_last)  # type: ignore[call-overload]
    latents = corpus.latents(vae)
    conditional_prior = start.conditional_prior if start is not None else None
    conditional_prior = conditional_prior or fit_conditional_prior(corpus, KINDS, vae, codec, recipe.seed)
    expected = prior_latents(corpus, conditional_prior, vae, codec)
    for each in (run.net, run.mean):
        each.spread.copy_(latents.float().std(dim=(0, 1, 3, 4)))
    guess_of = torch.compile(run.net) if compiled else run.net

    def keep(step: int, hours: float) -> None:
        before = {} if start is None else {"start": start.facts}
        facts = {**asdict(recipe), **before, "steps": step, "hours": hours, "views": len(corpus)}
        model = EnvironmentModel(run.mean, vae, text, codec, shape, facts, conditional_prior=conditional_prior)
        write_environment_model(out / BASE_FILE, model)
        if recipe.later and step <= recipe.later_from:
            write_environment_model(out / WITHOUT_FILE, model)

    for step in run.steps(save_every, keep, progress):
        rng = np.random.default_rng([recipe.seed, 17, step])
        hidden = recipe.later if step < recipe.later_from else ""
        batch = draw_batch(corpus, text, recipe.items, rng, without=hidden)
        sides = [int(m) for m in batch.mirrored]
        clean = latents[sides, batch.index].float().to(device)
        noisy, timesteps, target = diffuse(clean, torch.Generator().manual_seed(recipe.seed * 1_000_003 + step))
        layout_maps = torch.from_numpy(layout_maps_of(corpus, batch, rng)).to(device)
        mean, spread = (each[sides, batch.index].float().to(device) for each in expected)
        told = {"layout_map": layout_maps, "expected": mean, "spread": spread}
        with precision(device):
            guess = guess_of(noisy, timesteps, batch.tokens.to(device), cross_attention_kwargs=told).sample
        here = (layout_maps[:, -1].amax(dim=(1, 2)) > NO_LAYOUT_MAP)[:, None, None, None]
        scale = torch.where(here, spread, run.net.spread[:, None, None])
        run.learn(weighted_velocity_loss(guess, target, timesteps, scale))
    return out / BASE_FILE


def prior_latents(
    corpus: ViewCorpus, conditional_prior: ConditionalPrior, vae: PatchAutoencoder, codec: PirCodec
) -> tuple[Tensor, Tensor]:
    """Means and spreads, each (2, view, latent, row, column), that are expected of the sketches and of their mirror
    images, with the brightness that each kind of thing has in each image; half precision."""
    means, spreads = [], []
    for mirror in (False, True):
        for start in range(0, len(corpus), 256):
            some = range(start, min(start + 256, len(corpus)))
            layout_maps, views = (
                np.stack([corpus.layout_map(i, mirror) for i in some]),
                [corpus.view(i, mirror) for i in some],
            )
            images = [corpus.image(i, mirror) for i in some]
            bright = [
                brightness_offsets(conditional_prior, image, layout_map, view, codec)
                for image, layout_map, view in zip(images, layout_maps, views, strict=True)
            ]
            found = conditional_prior.of(layout_maps, views, bright, vae, codec)
            means.append(found.mean.half())
            spreads.append(found.spread.half())
    shape = (2, len(corpus), *means[0].shape[1:])
    return torch.cat(means).reshape(shape), torch.cat(spreads).reshape(shape)


def layout_maps_of(corpus: ViewCorpus, batch: ViewBatch, rng: np.random.Generator) -> NDArray[np.float32]:
    """(item, CHANNELS, row, column), some of them left out."""
    layout_maps = np.stack([corpus.layout_map(i, m) for i, m in zip(batch.index, batch.mirrored, strict=True)])
    layout_maps[rng.uniform(size=len(layout_maps)) < _UNSKETCHED, -1] = NO_LAYOUT_MAP
    return layout_maps


def diffuse(clean: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Noisy latents, their time steps, and the velocities that are to be guessed."""
    scheduler = make_scheduler()
    count = scheduler.config.num_train_timesteps
    drawn = 1.0 - torch.rand(len(clean), generator=generator) ** _HIGH_NOISE
    steps = (count * drawn).long().clamp(0, count - 1).to(clean.device)
    noise = torch.randn(clean.shape, generator=generator).to(clean.device)
    share = scheduler.alphas_cumprod.to(clean.device)[steps][:, None, None, None]
    noisy = share.sqrt() * clean + (1 - share).sqrt() * noise
    return noisy, steps, share.sqrt() * noise - (1 - share).sqrt() * clean


def weighted_velocity_loss(guess: Tensor, target: Tensor, steps: Tensor, spread: Tensor) -> Tensor:
    """Mean square error of velocities (image, latent, row, column), weighted so that what a network draws itself counts
    alike at all time steps (image,), and by the square of how far latents stray, `spread`."""
    signal, noise = signal_and_noise(steps)
    return (((signal * spread) ** 2 + noise**2) * (guess.float() - target) ** 2).mean()
