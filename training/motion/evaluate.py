"""Examine a motion model: `python -m training.motion.evaluate --data FOLDER --out FOLDER`.

Writes `metrics.json`, the table of the model card, `figures.md`, and stick-figure strips; `--data` is the training
command's `--out`. With `--mocap FOLDER` captured motion is examined too. Motions are made as prompts make them by
default, from drafts; those made from noise alone are examined beside them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from rfgen_sionna.generative.diffusion.diffusion_source import REFINED, DiffusionSource
from rfgen_sionna.generative.diffusion.motion_sampling import MotionSampler
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from training.commands import progress_bar
from training.motion import motion_evaluation as evaluation
from training.motion.figures import table
from training.motion.kinematic_clips import read_clips, synthesise
from training.motion.pictures import strips
from training.motion.train import Mocap, Out, prepare


def main(
    data: Annotated[Path, typer.Option(help="The training command's --out.")],
    out: Out,
    mocap: Mocap = None,
    model: Annotated[Path | None, typer.Option(help="Model file; none: the one that ships.")] = None,
    seeds: Annotated[int, typer.Option(min=1, help="How many seeds.")] = 3,
    each: Annotated[int, typer.Option(min=2, help="Motions of each action and seed.")] = 12,
    clips: Annotated[int, typer.Option(min=2, help="Clips of each action in the training set.")] = 300,
    steps: Annotated[int, typer.Option(min=2, max=200, help="Steps of the sampler.")] = MotionSampler.steps,
    guidance: Annotated[
        float, typer.Option(min=0.0, max=10.0, help="Guidance of the sampler.")
    ] = MotionSampler.guidance,
    refine: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Noise level from which drafts are made anew; 0: from noise only.")
    ] = REFINED,
    workers: Annotated[int, typer.Option(min=1, help="Processes that synthesise clips.")] = 1,
) -> None:
    """Examine a motion model and write figures and pictures."""
    out.mkdir(parents=True, exist_ok=True)
    sampler = MotionSampler(steps=steps, guidance=guidance)
    source, plain = (DiffusionSource(model, sampler, refine=r) for r in (refine or None, None))
    with progress_bar() as bar:
        corpus = prepare(data, mocap, clips=clips, seed=0, workers=workers, bar=bar)
        task = bar.add_task("clips of another seed", total=None, note="")
        files = synthesise(
            data / "kinematic-fresh",
            25,
            seed=1,
            workers=workers,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
        fresh = [clip for path in files for clip in read_clips(path)]
        judging = bar.add_task("judge", total=None, note="")
        real = evaluation.reference(
            fresh, corpus, progress=lambda done, total, _: bar.update(judging, completed=done, total=total)
        )
        parts = seeds * (len(CLAUSES) * (2 if source.refine else 1) + len(evaluation.PARTS))
        task = bar.add_task("examination", total=parts, note="")

        def note(line: str) -> None:
            bar.update(task, advance=1, note=f"seed {seed}: {line}")
            if not bar.console.is_terminal:
                bar.console.print(f"seed {seed}: {line}")

        results: dict[str, Any] = {
            "model": source.model.facts, "refined at": source.refine, "seeds": [], "from noise": [],
        }  # fmt: skip
        for seed in range(seeds):
            results["seeds"].append(evaluation.examine(source, real, corpus, each=each, seed=seed, note=note))
            if source.refine:
                results["from noise"].append(
                    evaluation.examine_actions(plain, real, each=each, seed=seed, note=note)[1]
                )
            (out / "metrics.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
            (out / "figures.md").write_text(table(results), encoding="utf-8")
    strips(source, out / "strips.png")


if __name__ == "__main__":
    typer.run(main)
