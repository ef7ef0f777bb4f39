"""Train an RF LoRA: `python -m training.environment.lora --data FOLDER --out FOLDER`.

DreamBooth's way: a few hundred PIRs, their captions, and the attention layers of a base that otherwise stays as it is.
The settings that are given are the paper's (800 frames, 100 steps, 1e-4). With several `--rate` each is tried and the
one that does best on the validation split is kept. The same command goes on where it was stopped.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rfgen_sionna.generative.environment.adapters import WEIGHT_NAME
from rfgen_sionna.generative.environment.torch_device import pick_device
from training.commands import plainly, progress_bar
from training.environment.lora_bases import Base, open_base
from training.environment.lora_training import LoraRecipe, choose_rate
from training.environment.pir_data import PirData
from training.environment.train import Data
from training.environment.view_corpus import read_corpus


def main(
    data: Data,
    out: Annotated[Path, typer.Option(help="Folder for checkpoints and the result.")],
    base: Annotated[
        str | None,
        typer.Option(help="Folder or hub name of a Stable Diffusion base, or our own model; none: the one that ships."),
    ] = None,
    place: Annotated[
        list[str] | None, typer.Option(help="Places to learn; none: all. May be given several times.")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, help="Views to learn from.")] = LoraRecipe.frames,
    steps: Annotated[int, typer.Option(min=1, help="Optimiser steps.")] = LoraRecipe.steps,
    items: Annotated[int, typer.Option(min=1, help="Views a step.")] = LoraRecipe.items,
    rate: Annotated[
        list[float] | None, typer.Option(help="Learning rate; several are tried and the best is kept.")
    ] = None,
    rank: Annotated[int, typer.Option(min=1, help="Rank of the additions.")] = LoraRecipe.rank,
    convolutions: Annotated[bool, typer.Option(help="Adapt convolutions too.")] = False,
    text_encoder: Annotated[bool, typer.Option(help="Adapt the text encoder too (Stable Diffusion).")] = False,
    word: Annotated[str, typer.Option(help="Word that prompts shall begin with.")] = "",
    edge: Annotated[
        int | None, typer.Option(min=8, help="Edge of the pictures [pixels]; none: the base's own.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = 0,
    device: Annotated[str | None, typer.Option(help="cpu, cuda, …; none: CUDA where there is one.")] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads on the CPU.")] = 2,
) -> None:
    """Train an RF LoRA, or go on with it."""
    import torch

    torch.set_num_threads(threads)
    where = pick_device(device)
    recipe = LoraRecipe(frames, steps, items, rank, convolutions, text_encoder, word, seed)
    views = PirData.open(data).select(place=place or None)

    def fresh_base() -> Base:
        return open_base(base, where, edge)

    codec = fresh_base().codec
    learn, classifier = (read_corpus(views.select(split=split), codec) for split in ("train", "validation"))
    rates = rate or [LoraRecipe.paper_rate]
    with progress_bar() as bar:
        tasks = {r: bar.add_task(f"rate {r:g}", total=steps, note="") for r in rates}
        outcome = choose_rate(
            fresh_base,
            learn,
            classifier,
            out,
            recipe,
            rates,
            progress=lambda r, step, loss: bar.update(tasks[r], completed=step, note=f"loss {loss:.4f}"),
        )
    (out / "lora.json").write_text(json.dumps(outcome.report(), indent=1), encoding="utf-8")
    Console().print(f"LoRA: {out / WEIGHT_NAME}, rate {outcome.rate:g}, {outcome.share:.2%} of the parameters")


if __name__ == "__main__":
    typer.run(plainly(main))
