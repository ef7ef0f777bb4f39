"""Train a base that has never seen a PIR: `python tests/benchmarks/ordinary_base.py --out BASE --compile`.

The embedded model's network on ordinary pictures, for the examination of RF LoRA as it is used on Stable Diffusion:

    python -m training.environment.evaluate --data DATA --out REPORT --seeds 0 --view-count 0 \\
        --lora-base BASE/environment.safetensors --lora-steps 250 --lora-rank 5 --lora-convolutions \\
        --lora-rate 5e-3 --lora-rate 1e-2 --lora-rate 2e-2

No pictures of others are needed: dead leaves (discs that cover each other, with sizes of a power law) have the edges,
the spectra and the marginals of photographs (Lee, Mumford and Huang, "Occlusion Models for Natural Images", 2001). As
photographs do, they differ in contrast, colourfulness, sharpness, grain, and in how near they were taken.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from diffusers.models.attention_processor import AttnProcessor
from scipy.ndimage import gaussian_filter

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.environment_model import BASE_FILE, EnvironmentModel, read_model
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from training.commands import progress_bar
from training.environment.fits import fit_autoencoder
from training.environment.image_training import diffuse, weighted_velocity_loss
from training.learning import Run, precision
from training.model_files import write_environment_model

_EDGE = 64
_SMALLEST, _LARGEST = 2.0, 40.0
"""Radii of discs [pixels]; their number falls with the cube of it."""
_NEAREST = 8.0
"""How much nearer the nearest pictures are taken than the farthest."""
_DISCS = 400


@dataclass(frozen=True)
class Recipe:
    """What decides the outcome."""

    steps: int = 2500
    items: int = 32
    rate: float = 6e-4
    seed: int = 0
    average: float = 0.99
    pictures: int = 3000


def dead_leaves(rng: np.random.Generator) -> FloatArray:
    """(3, 64, 64) colours in −1 … 1."""
    share = rng.uniform(size=_DISCS)
    smallest = _SMALLEST * np.exp(rng.uniform(0.0, np.log(_NEAREST)))
    # the inverse of the share of discs up to a radius r whose density falls as r^-3
    radius = (smallest**-2 + share * (_LARGEST**-2 - smallest**-2)) ** -0.5
    place = rng.uniform(-_LARGEST, _EDGE + _LARGEST, (_DISCS, 2))
    row, column = np.mgrid[:_EDGE, :_EDGE]
    inside = (row - place[:, 0, None, None]) ** 2 + (column - place[:, 1, None, None]) ** 2 < radius[:, None, None] ** 2
    first = inside.argmax(axis=0)
    # those of one picture belong together
    grey, hue = rng.normal(0.0, 0.35, (_DISCS, 1)), rng.normal(0.0, 0.35 * rng.uniform(), (_DISCS, 3))
    colours = rng.uniform(-0.7, 0.7, 3) + np.exp(rng.uniform(np.log(0.15), 0.0)) * (grey + hue)
    # each leaf has a shade of its own, from one side to the other
    slope = rng.normal(0.0, 0.3 * rng.uniform(), (2, _DISCS)) / _EDGE
    shade = slope[0][first] * row + slope[1][first] * column
    picture = gaussian_filter(np.moveaxis(colours[first], -1, 0) + shade, (0.0, *[rng.uniform(0.0, 1.5)] * 2))
    return np.clip(picture + rng.normal(0.0, 0.02 * rng.uniform(), picture.shape), -1.0, 1.0)


def some_view(rng: np.random.Generator) -> ViewFacts:
    """What the base is told of a view, which means nothing to it."""
    fov = float(rng.uniform(40, 100))
    return ViewFacts((fov, fov), rng.uniform(0.5, 2.0), rng.uniform(-0.1, 0.4), rng.uniform(-np.pi, np.pi))


def main(
    out: Annotated[Path, typer.Option(help="Folder for checkpoints and the result.")],
    steps: Annotated[int, typer.Option(help="Optimiser steps.")] = Recipe.steps,
    seed: Annotated[int, typer.Option(help="Seed of everything.")] = Recipe.seed,
    threads: Annotated[int, typer.Option(help="Threads on the CPU.")] = 2,
    compiled: Annotated[
        bool, typer.Option("--compile/--no-compile", help="Compile the network: quicker, and needs a C++ compiler.")
    ] = False,
) -> None:
    """Train the base, or go on with it."""
    torch.set_num_threads(threads)
    torch.manual_seed(seed)
    out.mkdir(parents=True, exist_ok=True)
    recipe, own = Recipe(steps=steps, seed=seed), read_model()
    rng = np.random.default_rng([seed, 61])
    pictures = np.stack([dead_leaves(rng) for _ in range(recipe.pictures)])
    vae = fit_autoencoder(pictures, own.shape.latents)
    latents = vae.encode(torch.from_numpy(pictures).float()).latent_dist.mode()
    run = Run(own.shape.unet(), recipe, out / "checkpoint.pt", out / "log.jsonl")
    run.net.set_attn_processor(AttnProcessor())
    for net in (run.net, run.mean):
        net.spread.copy_(latents.std(dim=(0, 2, 3)))

    guess_of = torch.compile(run.net) if compiled else run.net

    def keep(step: int, hours: float) -> None:
        facts = {**asdict(recipe), "steps": step, "hours": hours, "pictures of": "dead leaves"}
        write_environment_model(out / BASE_FILE, EnvironmentModel(run.mean, vae, own.text, own.codec, own.shape, facts))

    with progress_bar() as bar:
        task = bar.add_task("pictures", total=steps, note="")

        def told(step: int, _: int, loss: float) -> None:
            bar.update(task, completed=step, note=f"loss {loss:.3f}")

        for step in run.steps(100, keep, told):
            rng = np.random.default_rng([seed, 67, step])
            clean = latents[rng.integers(len(latents), size=recipe.items)]
            texts = ["a picture" if rng.uniform() < 0.5 else "" for _ in clean]
            tokens = own.text.embed(texts, [some_view(rng) for _ in clean])
            noisy, times, target = diffuse(clean, torch.Generator().manual_seed(seed * 1_000_003 + step))
            with precision():
                guess = guess_of(noisy, times, tokens).sample
            run.learn(weighted_velocity_loss(guess, target, times, run.net.spread[:, None, None].expand(clean.shape)))


if __name__ == "__main__":
    typer.run(main)
