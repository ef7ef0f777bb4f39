"""Train the environment model: `python -m training.environment.train --data FOLDER --out FOLDER`.

Everything comes from the seed. What is there already in `--out` (autoencoder, sentence encoder, checkpoint) is kept, so
the same command goes on where it was stopped. Only the data set's training split is looked at.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.environment_model import read_model
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder
from rfgen_sionna.generative.environment.torch_device import pick_device
from rfgen_sionna.pir.codec import PirCodec
from training.commands import plainly, progress_bar
from training.environment.fits import fit_autoencoder
from training.environment.image_training import ImageRecipe, train
from training.environment.pir_data import PirData
from training.environment.place_text import train_text
from training.environment.view_corpus import ViewCorpus, read_corpus

_FITTED_ON = 2000
"""Views that the autoencoder is fitted on."""

Data = Annotated[Path, typer.Option(help="Folder of rendered views (training.environment.render makes them).")]
Out = Annotated[Path, typer.Option(help="Folder for checkpoints and the result.")]
Device = Annotated[str, typer.Option(help="cpu, cuda, cuda:1, …")]


def autoencoder(out: Path, corpus: ViewCorpus, *, latents: int, seed: int) -> PatchAutoencoder:
    """The fitted autoencoder, kept in `out`."""
    folder = out / "vae"
    if folder.is_dir():
        return PatchAutoencoder.from_pretrained(folder).requires_grad_(False)
    some = np.random.default_rng([seed, 5]).permutation(len(corpus))[:_FITTED_ON]
    images = corpus.images[some].astype("float32")
    images[::2] = images[::2, :, :, ::-1]
    vae = fit_autoencoder(images, latents)
    vae.save_pretrained(folder)
    return vae


def sentence_encoder(out: Path, corpus: ViewCorpus, *, steps: int, seed: int, bar: Progress) -> PlaceEncoder:
    """The trained sentence encoder, kept in `out`."""
    from safetensors import safe_open
    from safetensors.torch import load_file, save_file

    path = out / "text.safetensors"
    if path.is_file():
        with safe_open(path, "pt") as file:
            header = json.loads((file.metadata() or {})["rfgen"])
        encoder = PlaceEncoder(header["places"], header["things"])
        encoder.load_state_dict(load_file(path))
        return encoder.eval().requires_grad_(False)
    task = bar.add_task("sentences", total=steps, note="")
    encoder = train_text(
        corpus.draw,
        corpus.names,
        corpus.things,
        seed=seed,
        steps=steps,
        progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.3f}"),
    )
    names = {"places": encoder.places, "things": encoder.things}
    save_file(encoder.state_dict(), path, {"rfgen": json.dumps(names)})
    return encoder


def main(
    data: Data,
    out: Out,
    start: Annotated[
        Path | None,
        typer.Option(help="A trained model to begin with; its autoencoder and sentence encoder are kept."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything.")] = 0,
    steps: Annotated[
        int, typer.Option(min=1, help="Optimiser steps; more or fewer may be asked for when going on.")
    ] = ImageRecipe.steps,
    items: Annotated[int, typer.Option(min=1, help="Images a step.")] = ImageRecipe.items,
    rate: Annotated[float, typer.Option(min=1e-9, help="Learning rate.")] = ImageRecipe.rate,
    average: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Decay of the running mean of the weights.")
    ] = ImageRecipe.average,
    later: Annotated[str, typer.Option(help="A place that is shown only from step --later-from on.")] = "",
    later_from: Annotated[int, typer.Option(min=0, help="That step.")] = 0,
    text_steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of the sentence encoder.")] = 500,
    latents: Annotated[int, typer.Option(min=1, max=48, help="Components kept of each patch of 4 x 4 pixels.")] = 32,
    device: Device = "cpu",
    threads: Annotated[int, typer.Option(min=1, help="Threads of the optimiser on the CPU.")] = 2,
    compiled: Annotated[
        bool, typer.Option("--compile/--no-compile", help="Compile the network: quicker, and needs a C++ compiler.")
    ] = False,
) -> None:
    """Train the environment model, or go on with it."""
    import torch

    torch.set_num_threads(threads)
    device = pick_device(device)
    out.mkdir(parents=True, exist_ok=True)
    begun = None if start is None else read_model(start)
    codec = PirCodec() if begun is None else begun.codec
    with progress_bar() as bar:
        reading = bar.add_task("views", total=1, note="")
        corpus = read_corpus(PirData.open(data).select(split="train"), codec, use_layout_map=True)
        bar.update(reading, completed=1, note=str(len(corpus)))
        if begun is None:
            vae = autoencoder(out, corpus, latents=latents, seed=seed)
            encoder = sentence_encoder(out, corpus, steps=text_steps, seed=seed, bar=bar)
        else:
            vae, encoder = begun.vae, begun.text
        task = bar.add_task("images", total=steps, note="")
        path = train(
            corpus,
            vae,
            encoder,
            out,
            ImageRecipe(
                steps=steps, items=items, rate=rate, seed=seed, average=average, later=later, later_from=later_from
            ),
            shape=None if begun is None else begun.shape,
            codec=codec,
            start=begun,
            device=device,
            compiled=compiled,
            progress=lambda step, _, loss: bar.update(task, completed=step, note=f"loss {loss:.4f}"),
        )
    Console().print(f"model: {path}")


if __name__ == "__main__":
    typer.run(plainly(main))
