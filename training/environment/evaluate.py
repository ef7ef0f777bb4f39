"""Examine the environment model: `python -m training.environment.evaluate --data FOLDER --out FOLDER`.

Writes `metrics.json` and a picture of rendered beside drawn views. With `--pairs` path diffusion is examined, and shown
in a picture of its own; with `--lora-base` an RF LoRA on a place that this base hasn't seen. The judge learns from the
training split; what is measured comes from the test split.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import typer

from rfgen_sionna.generative.environment.classifier import ImageClassifier, untrained_classifier
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.image_models import load_embedded
from rfgen_sionna.generative.environment.image_sampling import ImageSampler
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from training.commands import plainly, progress_bar
from training.environment.classifier_training import train_classifier
from training.environment.contact_sheets import completed_sheet, sheet
from training.environment.image_evaluation import examine
from training.environment.image_metrics import correctly_named
from training.environment.lora_evaluation import RATES, examine_lora
from training.environment.lora_training import LoraRecipe
from training.environment.path_evaluation import examine_paths
from training.environment.pir_data import PirData
from training.environment.train import Data, Out
from training.environment.view_corpus import ViewCorpus, read_corpus
from training.environment.view_evaluation import examine_views

_BANK = 2500
"""Training images among which copies are looked for."""


def load_classifier(out: Path, train: ViewCorpus, steps: int, bar: Any) -> ImageClassifier:
    """The judge, trained or from `out`."""
    path = out / "judge.pt"
    if path.is_file():
        classifier = untrained_classifier(len(train.names))
        classifier.net.load_state_dict(torch.load(path, weights_only=True))
        return classifier
    task = bar.add_task("judge", total=steps, note="")
    classifier = train_classifier(
        train.images,
        train.places,
        train.views,
        steps=steps,
        progress=lambda step, *_: bar.update(task, completed=step),
    )
    torch.save(classifier.net.state_dict(), path)
    return classifier


def main(
    data: Data,
    out: Out,
    model: Annotated[Path | None, typer.Option(help="Model; none: the one that ships.")] = None,
    other: Annotated[
        list[Path] | None,
        typer.Option(help="Views of another kind, rolled or in another projection, of layouts not seen; repeat it."),
    ] = None,
    pairs: Annotated[Path | None, typer.Option(help="Folder of pairs; none: path diffusion isn't examined.")] = None,
    control: Annotated[Path | None, typer.Option(help="ControlNet; none: the one beside the model.")] = None,
    lora_base: Annotated[Path | None, typer.Option(help="Model that has not seen --lora-place.")] = None,
    lora_place: Annotated[str, typer.Option(help="That place.")] = "garage",
    lora_steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of that RF LoRA.")] = LoraRecipe.steps,
    lora_rank: Annotated[int, typer.Option(min=1, help="Rank of that RF LoRA.")] = LoraRecipe.rank,
    lora_convolutions: Annotated[bool, typer.Option(help="Whether it adapts convolutions too.")] = False,
    lora_rate: Annotated[
        list[float] | None, typer.Option(help="Its learning rates; the best on the validation split counts.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=0, help="How many seeds.")] = 3,
    each: Annotated[int, typer.Option(min=1, help="Views of each place, half and seed: whole layouts.")] = 24,
    view_count: Annotated[int, typer.Option(min=0, help="Environments of which several views are compared.")] = 16,
    pair_count: Annotated[int, typer.Option(min=1, help="Pairs on which path diffusion is examined.")] = 150,
    strength: Annotated[float, typer.Option(min=0.0, max=1.0, help="Strength of path diffusion.")] = 1.0,
    steps: Annotated[int, typer.Option(min=1, max=1000, help="Steps of the sampler.")] = ImageSampler.steps,
    guidance: Annotated[
        float, typer.Option(min=1.0, max=20.0, help="Guidance of the sampler.")
    ] = ImageSampler.guidance,
    use_layout_map: Annotated[
        bool, typer.Option("--sketched/--words-alone", help="Draw over sketches, or from words alone.")
    ] = True,
    split: Annotated[str, typer.Option(help="test; or validation, to choose settings with.")] = "test",
    judge_steps: Annotated[int, typer.Option(min=1, help="Optimiser steps of the judge.")] = 2500,
    half: Annotated[bool, typer.Option(help="Draw in half precision.")] = False,
    threads: Annotated[int, typer.Option(min=1, help="Threads on the CPU.")] = 2,
) -> None:
    """Examine the models and write figures and a picture."""
    torch.set_num_threads(threads)
    out.mkdir(parents=True, exist_ok=True)
    own = load_embedded(model, None, None, half=half)
    views = PirData.open(data)
    held = views.select(split=split)
    if not len(held):
        raise ValueError(f"data: {str(data)!r} has no views of the split {split!r}; render more of them")
    train, test = (read_corpus(part, own.codec) for part in (views.select(split="train"), held))
    bank = train.images[np.random.default_rng(0).permutation(len(train))[:_BANK]]
    sampler = ImageSampler("ddim", steps, guidance)
    report: dict[str, Any] = {
        "model": own.facts,
        "sampler": {"steps": steps, "guidance": guidance, "sketched": use_layout_map},
        "split": split,
    }

    def write() -> None:
        (out / "metrics.json").write_text(json.dumps(report, indent=1), encoding="utf-8")

    with progress_bar() as bar:
        classifier = load_classifier(out, train, judge_steps, bar)
        _, probabilities = classifier.classify(test.images, test.views)
        report["judge on held-out renders"] = {
            "views": float(correctly_named(probabilities, test.places).mean()),
            "all views of a layout together": float(correctly_named(probabilities, test.places, held.layout).mean()),
        }
        report["surroundings"] = []
        for seed in range(seeds):
            task = bar.add_task(f"surroundings, seed {seed}", total=None, note="")

            def note(done: int, total: int, task: Any = task) -> None:
                bar.update(task, completed=done, total=total)

            figures, images, which = examine(
                own, test, held.layout, bank, classifier, sampler=sampler, each=each, seed=seed,
                use_layout_map=use_layout_map, note=note,
            )  # fmt: skip
            report["surroundings"].append(figures)
            write()
            if seed == 0:
                sheet(test, which.first, images, own.codec, out / "environment-model.png")
        for folder in other or ():
            part = PirData.open(folder)
            if np.isin(part.layout, views.select(split="train").layout).any():
                raise typer.BadParameter(f"other: {folder} shares layouts with the training split; render another seed")
            task = bar.add_task(folder.name, total=1, note="")
            figures, _, _ = examine(
                own, read_corpus(part, own.codec), part.layout, bank, classifier, sampler=sampler, each=each, seed=0,
                use_layout_map=use_layout_map,
            )  # fmt: skip
            report.setdefault("other views", {})[folder.name] = figures
            bar.update(task, completed=1)
            write()
        if view_count:
            task = bar.add_task("several views", total=1, note="")
            rooms = EnvironmentDiffusion(
                model, steps=steps, guidance=guidance, use_layout_map=use_layout_map, half=half
            )
            report["several views"] = examine_views(rooms, test, count=view_count, seed=0)
            bar.update(task, completed=1)
            write()
        if pairs is not None:
            task = bar.add_task("path diffusion", total=1, note="")
            sets = PirData.open(pairs)
            few, many = (read_corpus(sets.select(split=name), own.codec, pairs=True) for name in (split, "train"))
            refiner = PathDiffusion(model, control, half=half)
            report["path diffusion"] = examine_paths(refiner, few, many, strength=strength, count=pair_count, seed=0)
            completed_sheet(few, refiner, out / "path-diffusion.png", strength=strength)
            bar.update(task, completed=1)
            write()
        if lora_base is not None:
            task = bar.add_task("RF LoRA", total=1, note="")
            report["RF LoRA"] = examine_lora(
                lora_base,
                views,
                lora_place,
                classifier,
                out / "lora",
                sampler=sampler,
                rates=lora_rate or RATES,
                steps=lora_steps,
                rank=lora_rank,
                convolutions=lora_convolutions,
                half=half,
            )
            bar.update(task, completed=1)
            write()


if __name__ == "__main__":
    typer.run(plainly(main))
