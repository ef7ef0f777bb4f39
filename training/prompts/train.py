"""Train the action reader: `python -m training.prompts.train --out FOLDER`.

Its sentences are made of the wordings in this folder. The result has the head, its limits of probability, chosen on
held-out sentences, and their figures of merit, as the file that the reader loads and as a card.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import torch
import typer
from rich.console import Console

from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.prompts.action_reader import ActionReader
from training.commands import plainly, progress_bar
from training.prompts.head_training import HeadRecipe, train_head, write_head
from training.prompts.reader_evaluation import chosen_limits, examination, figures, outcomes
from training.prompts.sentence_vectors import vectors_of
from training.prompts.sentences import captions, sentences


@plainly
def main(
    out: Annotated[Path, typer.Option(help="Folder for the result, action_reader.npz and action_reader.json.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = HeadRecipe.seed,
    steps: Annotated[int, typer.Option(min=1, help="Optimiser steps.")] = HeadRecipe.steps,
    threads: Annotated[int, typer.Option(min=1, help="Threads on the CPU.")] = 2,
) -> None:
    """Train the action reader; vectors of sentences are kept in the folder, for the next time."""
    torch.set_num_threads(threads)
    out.mkdir(parents=True, exist_ok=True)
    recipe = HeadRecipe(seed=seed, steps=steps)
    corpus = sentences(recipe.sentences, seed) + captions(MotionLibrary())
    texts = [each.text for each in corpus]
    with progress_bar() as bar:
        reading = bar.add_task("sentences", total=len(texts), note="")
        vectors = vectors_of(texts, out / "vectors.npz", lambda done: bar.update(reading, completed=done))
        task = bar.add_task("training", total=steps, note="")
        head = train_head(
            corpus, vectors, recipe, lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.3f}")
        )
    path = out / "action_reader.npz"
    write_head(path, head, (0.0, 0.0, 0.0))
    held_out = examination()
    limits = chosen_limits(outcomes(ActionReader(head=path), held_out))
    write_head(path, head, limits)
    found = figures(outcomes(ActionReader(head=path), held_out))
    card = {
        "command": f"python -m training.prompts.train --out FOLDER --seed {seed} --steps {steps}",
        "recipe": vars(recipe),
        "sentences": len(corpus),
        "labels": head.labels,
        "least probability, all words known": limits[0],
        "least probability, some words unknown": limits[1],
        "least probability, first word unknown": limits[2],
        "held-out sentences": found,
    }
    (out / "action_reader.json").write_text(json.dumps(card, indent=1) + "\n", encoding="utf-8")
    Console().print(f"reader: {path}, {found}")


if __name__ == "__main__":
    typer.run(main)
