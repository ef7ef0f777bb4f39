"""Train the motion model: `python -m training.motion.train --mocap FOLDER --out FOLDER`.

Everything comes from the seed. What is there already in `--out` (clips, sentence encoder, checkpoint) is kept, so the
same command goes on where it was stopped.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder
from training.commands import progress_bar
from training.motion.kinematic_clips import synthesise
from training.motion.mocap import MocapClip, read_pack
from training.motion.motion_corpus import MotionCorpus, build
from training.motion.motion_text import Captions, train_text
from training.motion.motion_training import MotionRecipe, train

COMPOSED_SHARE = 0.15
"""Composed clips over synthesised ones."""

Mocap = Annotated[
    Path | None,
    typer.Option(help="Folder of the mocap pack: motions.npz and clips.json. None: synthesised motion only."),
]
Out = Annotated[Path, typer.Option(help="Folder for clips, checkpoints and the result.")]


def prepare(out: Path, mocap: Path | None, *, clips: int, seed: int, workers: int, bar: Progress) -> MotionCorpus:
    """The training set, from the clips in `out`, which are made where they are missing."""
    captures: list[MocapClip] = read_pack(mocap) if mocap is not None else []
    making = bar.add_task("clips", total=None, note="")
    files = synthesise(
        out / "kinematic",
        clips,
        seed=seed,
        workers=workers,
        progress=lambda done, total: bar.update(making, completed=done, total=total),
    )
    encoding = bar.add_task("features", total=None, note="")
    return build(
        files,
        captures,
        composed=round(COMPOSED_SHARE * clips * 20),
        seed=seed,
        progress=lambda done, total: bar.update(encoding, completed=done, total=total),
    )


def sentence_encoder(out: Path, corpus: MotionCorpus, *, steps: int, seed: int, bar: Progress) -> TextEncoder:
    """The trained sentence encoder, kept in `out`."""
    from safetensors import safe_open
    from safetensors.torch import load_file, save_file

    path = out / "text.safetensors"
    if path.is_file():
        with safe_open(path, "pt") as file:
            actions = tuple(json.loads((file.metadata() or {})["actions"]))
        encoder = TextEncoder(actions)
        encoder.load_state_dict(load_file(path))
    else:
        captured = [
            Captions(e.actions[0], e.captions)
            for e in corpus.entries
            if e.source == "mocap" and not e.held_out and not e.name.endswith("/mirrored")
        ]
        task = bar.add_task("sentences", total=steps, note="")
        encoder = train_text(
            captured,
            seed=seed,
            steps=steps,
            progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.3f}"),
        )
        save_file(encoder.state_dict(), path, {"actions": json.dumps(encoder.actions)})
    return encoder.eval().requires_grad_(False)


def main(
    out: Out,
    mocap: Mocap = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = 0,
    steps: Annotated[
        int, typer.Option(min=1, help="Optimiser steps; more or fewer may be asked for when going on.")
    ] = MotionRecipe.steps,
    clips: Annotated[int, typer.Option(min=2, help="Synthesised clips of each action.")] = 300,
    text_steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of the sentence encoder.")] = 1500,
    workers: Annotated[int, typer.Option(min=1, help="Processes that synthesise clips.")] = 2,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the optimiser.")] = 2,
) -> None:
    """Train the motion model, or go on with it."""
    import torch

    torch.set_num_threads(threads)
    out.mkdir(parents=True, exist_ok=True)
    with progress_bar() as bar:
        corpus = prepare(out, mocap, clips=clips, seed=seed, workers=workers, bar=bar)
        encoder = sentence_encoder(out, corpus, steps=text_steps, seed=seed, bar=bar)
        task = bar.add_task("motion", total=steps, note="")
        path = train(
            corpus,
            encoder,
            out,
            MotionRecipe(steps=steps, seed=seed),
            progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.3f}"),
        )
    Console().print(f"model: {path}")


if __name__ == "__main__":
    typer.run(main)
