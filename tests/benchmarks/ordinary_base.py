"""Train a base that has never seen a PIR: `python tests/benchmarks/ordinary_base.py --out BASE`.

The embedded model's network on ordinary pictures, for the examination of RF LoRA as it is used on Stable Diffusion:

    python -m rfgen_sionna.generative.environment.evaluate --data DATA --out REPORT --lora-base BASE \\
        --lora-steps 250 --lora-convolutions

No pictures of others are needed: dead leaves (discs that cover each other, with sizes of a power law) have the edges,
the spectra and the marginals of photographs (Lee, Mumford and Huang, "Occlusion Models for Natural Images", 2001).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import typer
from diffusers.models.attention_processor import AttnProcessor

from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.forward import even_loss
from rfgen_sionna.generative.environment.model import BASE_FILE, EnvironmentModel, read_model, write_model
from rfgen_sionna.generative.environment.text import ViewFacts
from rfgen_sionna.generative.environment.train import progress_bar
from rfgen_sionna.generative.environment.training import diffuse
from rfgen_sionna.generative.learning import Run, precision
from rfgen_sionna.records import FloatArray

_EDGE = 64
_SMALLEST, _LARGEST = 2.0, 40.0
"""Radii of discs [pixels]; their number falls with the cube of it."""
_DISCS = 400


@dataclass(frozen=True)
class Recipe:
    """What decides the outcome."""

    steps: int = 600
    items: int = 32
    rate: float = 6e-4
    seed: int = 0
    average: float = 0.99
    pictures: int = 3000


def dead_leaves(rng: np.random.Generator) -> FloatArray:
    """(3, 64, 64) colours in −1 … 1."""
    share = rng.uniform(size=_DISCS)
    # the inverse of the share of discs up to a radius r whose density falls as r^-3
    radius = (_SMALLEST**-2 + share * (_LARGEST**-2 - _SMALLEST**-2)) ** -0.5
    place = rng.uniform(-_LARGEST, _EDGE + _LARGEST, (_DISCS, 2))
    row, column = np.mgrid[:_EDGE, :_EDGE]
    inside = (row - place[:, 0, None, None]) ** 2 + (column - place[:, 1, None, None]) ** 2 < radius[:, None, None] ** 2
    first = inside.argmax(axis=0)
    # those of one picture belong together
    colours = np.clip(rng.normal(rng.uniform(-0.5, 0.5, 3), 0.35, (_DISCS, 3)), -1.0, 1.0)
    shade = rng.normal(0.0, 0.3, 2) @ np.stack([row, column]).reshape(2, -1) / _EDGE
    picture = np.moveaxis(colours[first], -1, 0) + shade.reshape(_EDGE, _EDGE)
    return np.clip(picture + rng.normal(0.0, 0.02, picture.shape), -1.0, 1.0)


def some_view(rng: np.random.Generator) -> ViewFacts:
    """What the base is told of a view, which means nothing to it."""
    fov = float(rng.uniform(40, 100))
    return ViewFacts((fov, fov), rng.uniform(0.5, 2.0), rng.uniform(-0.1, 0.4), rng.uniform(-np.pi, np.pi))


def main(
    out: Annotated[Path, typer.Option(help="Folder for checkpoints and the result.")],
    steps: Annotated[int, typer.Option(help="Optimiser steps.")] = Recipe.steps,
    seed: Annotated[int, typer.Option(help="Seed of everything.")] = Recipe.seed,
    threads: Annotated[int, typer.Option(help="Threads on the CPU.")] = 2,
) -> None:
    """Train the base, or go on with it."""
    torch.set_num_threads(threads)
    torch.manual_seed(seed)
    out.mkdir(parents=True, exist_ok=True)
    recipe, own = Recipe(steps=steps, seed=seed), read_model()
    rng = np.random.default_rng([seed, 61])
    pictures = np.stack([dead_leaves(rng) for _ in range(recipe.pictures)])
    vae = PatchAutoencoder.fit(pictures, own.shape.latents)
    latents = vae.encode(torch.from_numpy(pictures).float()).latent_dist.mode()
    run = Run(own.shape.unet(), recipe, out / "checkpoint.pt", out / "log.jsonl")
    run.net.set_attn_processor(AttnProcessor())
    for net in (run.net, run.mean):
        net.spread.copy_(latents.std(dim=(0, 2, 3)))

    def keep(step: int, hours: float) -> None:
        facts = {**asdict(recipe), "steps": step, "hours": hours, "pictures of": "dead leaves"}
        write_model(out / BASE_FILE, EnvironmentModel(run.mean, vae, own.text, own.codec, own.shape, facts))

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
                guess = run.net(noisy, times, tokens).sample
            run.learn(even_loss(guess, target, times, run.net.spread[:, None, None].expand(clean.shape)))


if __name__ == "__main__":
    typer.run(main)
