"""Train the motion model: `python -m training.motion.train --out FOLDER`.

It is trained on the motion library of the package and on the rules of movement, on a GPU where there is one. The same
command goes on where it was stopped.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console

from rfgen_sionna.generative.motion_library import FOLDER, MotionLibrary
from training.commands import plainly, progress_bar
from training.motion.row_corpus import build
from training.motion.variation_training import VariationRecipe, train


@plainly
def main(
    out: Annotated[Path, typer.Option(help="Folder for checkpoints and the result, variation.safetensors.")],
    library: Annotated[Path, typer.Option(help="Folder of the motion library.")] = FOLDER,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = VariationRecipe.seed,
    steps: Annotated[
        int, typer.Option(min=1, help="Optimiser steps; more or fewer may be asked for when going on.")
    ] = VariationRecipe.steps,
    device: Annotated[str, typer.Option(help="cpu, cuda or another of PyTorch; empty: a GPU where there is one.")] = "",
    threads: Annotated[int, typer.Option(min=1, help="Threads on the CPU.")] = 2,
) -> None:
    """Train the motion model, or go on with it."""
    torch.set_num_threads(threads)
    device = device or ("cuda" if torch.cuda.is_available() else "cpu")
    with progress_bar() as bar:
        reading = bar.add_task("motions", total=None, note="")
        corpus = build(
            MotionLibrary(library),
            seed=seed,
            progress=lambda done, all_: bar.update(reading, completed=done, total=all_),
        )
        task = bar.add_task("training", total=steps, note="")
        path = train(
            corpus,
            out,
            VariationRecipe(steps=steps, seed=seed),
            device=device,
            progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.3f}"),
        )
    Console().print(f"model: {path}")


if __name__ == "__main__":
    typer.run(main)
