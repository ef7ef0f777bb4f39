"""Scenes of the tables of fidelity: each simulated by default, and once more in place of a measurement.

What is called "measured" is no measurement. It is a simulation of the same scene at half the tolerance (denser facets,
rays and instants), with a board's impairments, and other seeds of noise and of rough surfaces; the default one has none
of that. All that both share, the package's physical optics and body, this comparison cannot test; recordings of real
people can (:func:`real_results`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.paper.reports import ROOT, progress
from rfgen_sionna.dataset import Run, open_run
from rfgen_sionna.evaluation import ControlledMetric
from rfgen_sionna.recipes import BodySpec, Recipe, RecordingSpec
from rfgen_sionna.recipes.making import IMPOSSIBLE, make_recording

IMPAIRMENTS: Mapping[str, Any] = {
    "phase_noise": {"points": [[1e5, -85.0], [1e6, -95.0]]},
    "mismatch": {"gain_spread_db": 0.5, "phase_spread_deg": 5.0},
    "iq_imbalance": {"gain_db": 0.3, "phase_deg": 2.0},
    "dc_offset": {"level_dbm": -70.0},
    "adc": {"bits": 12, "full_scale_dbm": -26.0},
}
"""Impairments of the receiver that is called measured."""
ACTIONS = ("a person marches in place", "a person does jumping jacks", "a person waves", "a person boxes")
"""Prompts of the scenes, one each."""
PLACES = ("furnished: a living room", "furnished: an office", "furnished: a lab", "furnished: a corridor")
"""Places of the scenes, one each."""
RADARS = (("awr1642", "awr1642boost", "sdk1"), ("iwr6843", "iwr6843isk", "out_of_box"))
"""Name, radar and preset of the radars that record each scene, at one place."""


@dataclass(frozen=True)
class SceneFiles:
    """Run files of one scene; each run has all radars."""

    name: str
    measured: Path
    default: Path
    other_body: Path
    """The default simulation with another person, who does the same."""


def recipe(quick: bool, seed: int) -> Recipe:
    """The scenes as the package simulates them by default."""
    count = 2 if quick else len(ACTIONS)
    lines = [
        f"count = {count}", f"seed = {2_000_000 + seed}", "duration_s = 0.4", "rtol = 0.01",
        f"prompts = {{grid = {list(ACTIONS[:count])}}}",
        "distance_m = {range = [1.8, 2.8]}", "azimuth_deg = {range = [-15.0, 15.0]}",
        "orientation_deg = {range = [-45.0, 45.0]}", f"places = {{choice = {list(PLACES[:count])}}}",
        'keep = ["adc", "labels"]',
    ]  # fmt: skip
    for name, radar, preset in RADARS[: 1 if quick else None]:
        lines += ["[[radars]]", f'name = "{name}"', f'radar = "{radar}"', f'preset = "{preset}"']
    return Recipe.parse("\n".join(lines) + "\n")


def measured(spec: RecordingSpec) -> RecordingSpec:
    """The recording that is called measured."""
    return replace(spec, seed=spec.seed + 1, rtol=spec.rtol / 2, receiver=IMPAIRMENTS)


def other_body(spec: RecordingSpec) -> RecordingSpec:
    """The same by somebody else."""
    return replace(spec, bodies=tuple(BodySpec(body.seed + 1) for body in spec.bodies))


def made_scenes(quick: bool, seed: int, folder: Path) -> list[SceneFiles]:
    """The scenes, simulated into a folder of the recipe in `folder`; those that are there are taken."""
    scenes, whole = [], recipe(quick, seed)
    folder = folder / whole.digest[:12]
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(whole.count):
        for attempt in range(whole.tables.attempts):
            spec = whole.recording(number, attempt)
            name = f"scene-{number}"
            files = SceneFiles(name, *(folder / f"{name}-{part}.h5" for part in ("measured", "default", "other-body")))
            try:
                for file, own in ((files.default, spec), (files.other_body, other_body(spec)),
                                  (files.measured, measured(spec))):  # fmt: skip
                    if not file.exists():
                        make_recording(own, file)
                        progress(f"{file.name}: {spec.prompt}, {spec.place}")
            except IMPOSSIBLE as error:
                progress(f"{name}: {error}")
                for file in (files.default, files.other_body, files.measured):
                    file.unlink(missing_ok=True)
            else:
                scenes.append(files)
                break
    if len(scenes) < 2:
        raise RuntimeError(f"{len(scenes)} of {whole.count} scenes could be made: two are needed, for the controls")
    return scenes


def opened(stack: ExitStack, files: SceneFiles, other: SceneFiles, radar: str) -> dict[str, Run]:
    """Runs of one radar: "measured", "default", and the controls "other scene" and "other body"."""
    paths = {
        "measured": files.measured, "default": files.default, "other scene": other.default,
        "other body": files.other_body,
    }  # fmt: skip
    found = {}
    for name, path in paths.items():
        run = stack.enter_context(open_run(path))
        found[name] = run[radar] if len(run.radars) > 1 else run
    return found


def summary(metrics: Iterable[ControlledMetric]) -> dict[str, Any]:
    """Mean over scenes of one metric, its controls and its margin, and the share of scenes whose margin is above 0."""
    each = list(metrics)
    margins = [metric.margin for metric in each]
    return {
        "unit": each[0].unit,
        "value": np.mean([metric.value for metric in each]),
        "controls": {name: np.mean([metric.controls[name] for metric in each]) for name in each[0].controls},
        "margin": np.mean(margins),
        "smallest margin": np.min(margins),
        "share above all controls": np.mean(np.array(margins) > 0),
        "scenes": len(each),
    }


def real_results() -> dict[str, list[str]]:
    """Result files of the experiments on real recordings, by experiment; figures stand there and are not copied."""
    found = {}
    for name in ("radhar", "mars"):
        folder = ROOT / "experiments" / name / "results"
        found[name] = [str(file.relative_to(ROOT)) for file in sorted(folder.glob("*.json"))]
    return found


def settings(quick: bool, seed: int) -> dict[str, Any]:
    """What both kinds of simulation are, for the report."""
    specs = list(recipe(quick, seed))
    scenes, denser = [asdict(spec) for spec in specs], measured(specs[0])
    first = scenes[0]
    return {
        "measured": {
            "is": "a simulation, no measurement", "rtol": denser.rtol, "receiver": dict(IMPAIRMENTS),
        },
        "default": {"rtol": first["rtol"], "receiver": first["receiver"]},
        "scenes": [f"{each['sources'][0]['text']}, {each['place']}" for each in scenes],
    }  # fmt: skip
