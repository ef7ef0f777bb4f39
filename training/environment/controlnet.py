"""Train path diffusion: `python -m training.environment.controlnet --data PAIRS --out FOLDER`.

It learns from pairs of the same view: what a hurried tracer sees, and everything there is. The base model stays as it
is. The same command goes on where it was stopped. When training ends a small judge learns from the same pairs to tell
incomplete images from complete ones, and how far the drawn gains hold is measured on the validation split; both go with
the weights.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rfgen_sionna.generative.environment.environment_model import read_control, read_model
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.torch_device import pick_device
from training.commands import plainly, progress_bar
from training.environment.classifier_training import train_confidence_gate
from training.environment.control_training import ControlRecipe, train_control
from training.environment.path_evaluation import calibrated
from training.environment.pir_data import PirData
from training.environment.train import Device
from training.environment.view_corpus import read_corpus
from training.model_files import write_control

_JUDGED = 64
"""Pairs of the validation split."""


def main(
    data: Annotated[Path, typer.Option(help="Folder of rendered pairs (training.environment.render makes them).")],
    out: Annotated[Path, typer.Option(help="Folder for checkpoints and the result.")],
    base: Annotated[Path | None, typer.Option(help="Base model; none: the one that ships.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = 0,
    steps: Annotated[
        int, typer.Option(min=1, help="Optimiser steps; more or fewer may be asked for when going on.")
    ] = ControlRecipe.steps,
    items: Annotated[int, typer.Option(min=1, help="Pairs a step.")] = ControlRecipe.items,
    rate: Annotated[float, typer.Option(min=1e-9, help="Learning rate.")] = ControlRecipe.rate,
    start: Annotated[
        Path | None, typer.Option(help="A trained ControlNet to begin with, of this base or another.")
    ] = None,
    device: Device = "cpu",
    threads: Annotated[int, typer.Option(min=1, help="Threads on the CPU.")] = 2,
) -> None:
    """Train the ControlNet, or go on with it."""
    import torch

    torch.set_num_threads(threads)
    device = pick_device(device)
    model = read_model(base)
    begun = None if start is None else read_control(start, model.unet, any_base=True).net
    with progress_bar() as bar:
        reading = bar.add_task("pairs", total=1, note="")
        corpus = read_corpus(PirData.open(data).select(split="train"), model.codec, pairs=True)
        bar.update(reading, completed=1, note=str(len(corpus)))
        task = bar.add_task("images", total=steps, note="")
        path = train_control(
            corpus,
            model,
            out,
            ControlRecipe(steps=steps, items=items, rate=rate, seed=seed),
            start=begun,
            device=device,
            progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.4f}"),
        )
        classifier = bar.add_task("completeness", total=None, note="")
        refiner = PathDiffusion(base, path, device=device)
        refiner.confidence_gate = train_confidence_gate(
            corpus, seed, progress=lambda step, steps, _: bar.update(classifier, completed=step, total=steps)
        )
        judged = bar.add_task("validation", total=1, note="")
        check = read_corpus(PirData.open(data).select(split="validation"), model.codec, pairs=True)
        confidence_gate = calibrated(refiner, check, count=_JUDGED, seed=seed)
        trained = read_control(path, model.unet)
        write_control(path, trained.net, trained.facts, confidence_gate)
        bar.update(judged, completed=1, note=f"share {confidence_gate.share:.2f}")
    Console().print(f"ControlNet: {path}")


if __name__ == "__main__":
    typer.run(plainly(main))
