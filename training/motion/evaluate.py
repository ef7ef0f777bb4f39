"""Measure the motion model: `python -m training.motion.evaluate --out docs/motion-model-metrics.json`.

Drafts are performed by the library and the rules of movement, and varied at several strengths: by the network and, to
compare, by noise of the same kind and size without a network.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES
from rfgen_sionna.generative.action_definitions import is_true_of
from rfgen_sionna.generative.diffusion.pose_rows import pose_rows
from rfgen_sionna.generative.diffusion.variation import changed, loaded, vary
from rfgen_sionna.generative.diffusion.variation_model import SHIPPED
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.performing import perform, performable
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.records import Motion
from training.commands import plainly, progress_bar
from training.motion.alignment import aligned_distance
from training.motion.row_corpus import HELD_OUT, SHORTEST
from training.motion.variation_measures import distance, foot_slide, mean_jerk, nearest_poses, pose_places

STRENGTHS = (0.3, 0.5, 0.7)
DURATION = 3.0
"""Length of the drafts [s]."""
_JERK = 10.0
"""Jerk under which motions count as still [m/s³]."""
Way = Callable[[Motion, str, float, int], Motion]
"""(draft, text, strength, seed): makes a variation."""


def by_noise(draft: Motion, text: str, strength: float, seed: int) -> Motion:
    """A variation as far from the draft as the network's, by noise alone."""
    goal = distance(vary(draft, text, strength=strength, seed=seed), draft)
    model = loaded(SHIPPED)
    rows, _ = pose_rows(draft)
    noise = model.scaling.rows[1] * model.noise.draw(np.random.default_rng([seed, 31]), len(rows))
    made = changed(draft, rows, 0.3 * noise)
    # distance is all but proportional to the noise
    return changed(draft, rows, 0.3 * goal / max(distance(made, draft), 1e-6) * noise)


def variety(motions: Sequence[Motion]) -> float:
    """Mean distance between one motion and the next, aligned in time [m]."""
    rows = [pose_places(motion) for motion in motions]
    return float(np.mean([aligned_distance(a, b) for a, b in pairwise(rows)]))


def measured(drafts: Mapping[str, Sequence[Motion]], way: Way, strength: float) -> dict[str, Any]:
    """Truth, distance, variety, slide and jerk of the variations of drafts, mean over actions."""
    columns: dict[str, list[float]] = {}
    true: dict[str, float] = {}
    for action, motions in drafts.items():
        text = f"a person {ACTION_CLAUSES.get(action, action.replace('_', ' '))}"
        made = [way(draft, text, strength, seed) for seed, draft in enumerate(motions)]
        pairs = list(zip(made, motions, strict=True))
        true[action] = float(np.mean([is_true_of(motion, action) for motion in made]))
        slides = [foot_slide(a, b) for a, b in pairs]
        for name, value in {
            "shows the action": true[action],
            "distance from the draft [m]": float(np.mean([distance(a, b) for a, b in pairs])),
            "distance between seeds [m]": variety(made),
            "foot slide [m/s]": float(np.nanmean(slides)) if np.isfinite(slides).any() else float("nan"),
            "jerk over the draft's, each with 10 m/s³ more": float(
                np.mean([(mean_jerk(a) + _JERK) / (mean_jerk(b) + _JERK) for a, b in pairs])
            ),
        }.items():
            columns.setdefault(name, []).append(value)
    worst = dict(sorted(true.items(), key=lambda each: each[1])[:8])
    return {name: round(float(np.nanmean(values)), 4) for name, values in columns.items()} | {"shown least": worst}


def likeness_to_people(way: Way, strength: float, clips: int) -> float:
    """Distance of varied clips of held-out people from the nearest poses of others who do the same, over that of the
    clips themselves, median: 1 for what others might do."""
    library = MotionLibrary()
    ratios = []
    for group in library.actions.values():
        own = [clip for clip in group if clip.subject in HELD_OUT and clip.frames >= SHORTEST][:clips]
        people = {clip.subject for clip in group} - set(HELD_OUT)
        if not own or len(people) < 2:
            continue
        others = [library.motion(clip.name) for clip in group if clip.subject in people]
        for seed, clip in enumerate(own):
            draft = library.motion(clip.name)
            made = way(draft, clip.captions[0], strength, seed)
            ratios.append(nearest_poses(made, others) / nearest_poses(draft, others))
    return float(np.median(ratios))


@plainly
def main(
    out: Annotated[Path, typer.Option(help="File of the figures, .json.")],
    weights: Annotated[Path, typer.Option(help="Model file.")] = SHIPPED,
    seeds: Annotated[int, typer.Option(min=2, help="Drafts of each action.")] = 3,
    clips: Annotated[int, typer.Option(min=1, help="Clips of each action of held-out people.")] = 2,
    actions: Annotated[int, typer.Option(min=1, help="Every how many-th action is measured.")] = 1,
) -> None:
    """Measure the motion model beside noise without a network."""

    def by_network(draft: Motion, text: str, strength: float, seed: int) -> Motion:
        return vary(draft, text, strength=strength, seed=seed, weights=weights)

    chosen = list(performable())[::actions]
    drafts: dict[str, list[Motion]] = {}
    with progress_bar() as bar:
        task = bar.add_task("drafts", total=len(chosen), note="")
        for action in chosen:
            try:
                drafts[action] = [perform(action, DURATION, seed) for seed in range(seeds)]
            except PromptError as error:
                Console().print(f"{action}: {error}")
            bar.advance(task)
        figures: dict[str, Any] = {
            "model": loaded(weights).facts,
            "actions": len(drafts),
            "seeds": seeds,
            "drafts": measured(drafts, lambda draft, *_: draft, 0.0),
        }
        task = bar.add_task("variations", total=len(STRENGTHS), note="")
        for strength in STRENGTHS:
            figures[f"strength {strength:g}"] = {
                name: measured(drafts, way, strength)
                | {"distance from other people over the clip's": likeness_to_people(way, strength, clips)}
                for name, way in (("network", by_network), ("noise", by_noise))
            }
            bar.advance(task)
            out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    Console().print_json(json.dumps(figures))


if __name__ == "__main__":
    typer.run(main)
