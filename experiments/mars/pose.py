"""Joints of people never seen, by a network trained on simulated clouds, on real ones, and on both.

    python -m experiments.mars.pose --data FOLDER --synthetic FOLDER --output joints.json

Each of `--subjects` is tested in turn, by networks trained on the others; `--test-subjects` are tested by networks
trained on all of `--subjects`. The simulated clouds are of the training people's joints. "k min" is the start of every
movement of the training people, k minutes together. Steps are fixed, and the last state counts.

S is the mean distance of joints, "mae" the mean absolute error over axes, which An and Ogras (MARS, ACM TECS 2021) give
as 5.87 cm for people in training and test alike; "seen people" is that case: the first 60 % of each movement of all
`--subjects` are trained on and the last 20 % tested.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from experiments.mars.body import POSE_FILE, MarsPose, read_pose
from experiments.mars.pose_frames import ROOT, PoseFrames, every, first_minutes, pose_frames
from experiments.mars.pose_network import TrainingPlan, estimate, train_network
from experiments.mars.recordings import read_clouds, read_subject
from rfgen_sionna.evaluation import BodyEstimates, compare_bodies

People = Mapping[int, Sequence[PoseFrames]]
"""Movements of each subject."""
MINUTES = (0.5, 1.0, 2.0)
"""Real recordings that are added or stand alone [min]."""
WINDOW_KERNEL = 5
"""Kernel of networks that see nine frames."""
PAPER_MAE_CM = 5.87
"""An and Ogras: mean over axes and joints, people in training and test alike."""


def training_sources(
    real: Sequence[PoseFrames], synthetic: Sequence[PoseFrames] | None, minutes: Sequence[float] = MINUTES
) -> dict[str, list[Sequence[PoseFrames]]]:
    """Sources of every training by name."""
    few = {f"{k:g} min": first_minutes(real, k) for k in minutes}
    sources: dict[str, list[Sequence[PoseFrames]]] = {"real": [real]}
    sources |= {f"real {name}": [part] for name, part in few.items()}
    if synthetic is not None:
        sources["synthetic"] = [synthetic]
        sources |= {f"synthetic and {name}": [synthetic, part] for name, part in few.items()}
        sources["synthetic and real"] = [synthetic, real]
    return sources


def errors(movements: Sequence[PoseFrames], found: Sequence[torch.Tensor], mean_pose: torch.Tensor) -> dict[str, Any]:
    """Figures of estimated joints [cm], with those of the mean pose and of the estimates in another order."""
    truth = torch.cat([movement.joints for movement in movements]).numpy()
    estimates = torch.cat(list(found)).numpy()
    order = np.random.default_rng(54).permutation(len(truth))
    others = {
        "mean pose": np.broadcast_to(mean_pose.numpy(), truth.shape),
        "shuffled frames": estimates[order],
    }
    whole = compare_bodies(_bodies(truth), _bodies(estimates), {name: _bodies(item) for name, item in others.items()})
    posture = compare_bodies(
        BodyEstimates(joints=_about_root(truth)),
        BodyEstimates(joints=_about_root(estimates)),
        {name: BodyEstimates(joints=_about_root(item)) for name, item in others.items()},
    )
    metrics = {"S": whole["S"], "S about the root": posture["S"], "root": whole["T"]}
    result: dict[str, Any] = {name: 100 * metric.value for name, metric in metrics.items()}
    result["mae"] = 100 * float(np.abs(estimates - truth).mean())
    result["mae of axes"] = [100 * float(value) for value in np.abs(estimates - truth).mean((0, 1))]
    result["S of movements"] = [
        100 * float((part - movement.joints).norm(dim=-1).mean())
        for movement, part in zip(movements, found, strict=True)
    ]
    result["controls"] = {
        name: {control: 100 * value for control, value in metric.controls.items()} for name, metric in metrics.items()
    }
    return result


def evaluate(
    training: People, synthetic: People | None, test: People, seeds: Sequence[int], plan: TrainingPlan, step: int = 1
) -> dict[str, Any]:
    """Errors of every test subject by source of training: mean and spread over seeds.

    Simulated frames are `step` real ones apart, and so are those that a network gets of real movements.

    Raises
    ------
    ValueError
        If a test subject is among the training ones.
    """
    shared = set(test) & (set(training) | set(synthetic or {}))
    if shared:
        raise ValueError(f"subjects {sorted(shared)} are trained on and tested: take others")
    sources = training_sources(every(_all(training), step), None if synthetic is None else _all(synthetic))
    trainings = [(name, parts, plan, step) for name, parts in sources.items()]
    if plan.kernel == 1:
        trainings.insert(1, ("real, 9 frames at a time", [_all(training)], replace(plan, kernel=WINDOW_KERNEL), 1))
    runs: dict[int, dict[str, list[dict[str, Any]]]] = {subject: {} for subject in test}
    for name, parts, own_plan, own_step in trainings:
        for seed in seeds:
            network = train_network(parts, seed, own_plan)
            for subject, movements in test.items():
                result = errors(movements, estimate(network, movements, own_step), network.mean_pose)
                runs[subject].setdefault(name, []).append(result)
                _progress(f"subject {subject}, {name}, seed {seed}: S {result['S']:.2f} cm")
    return {str(subject): _table(by_source) for subject, by_source in runs.items()}


def seen_people(people: People, seeds: Sequence[int], plan: TrainingPlan) -> dict[str, Any]:
    """Errors on the last 20 % of each movement, trained on the first 60 % of the same, 9 frames at a time."""
    movements = _all(people)
    training = [movement[: int(np.ceil(0.6 * len(movement)))] for movement in movements]
    test = [movement[-int(0.2 * len(movement)) :] for movement in movements]
    results = []
    for seed in seeds:
        network = train_network([training], seed, replace(plan, kernel=WINDOW_KERNEL))
        results.append(errors(test, estimate(network, test), network.mean_pose))
        _progress(f"seen people, seed {seed}: mae {results[-1]['mae']:.2f} cm")
    return _summary(results)


def read_people(
    data: Path, subjects: Sequence[int], radar: MarsPose, synthetic: Sequence[Path] = ()
) -> dict[int, list[PoseFrames]]:
    """Movements of subjects with the real clouds of `data`, or with simulated ones of all folders of `synthetic`.

    Joints are from the radar's place, along the data's axes.
    """
    place = np.array([radar.lateral_m, 0.0, radar.height_m])
    people: dict[int, list[PoseFrames]] = {}
    for subject in subjects:
        people[subject] = []
        for movement in read_subject(data, subject):
            files = [folder / f"{movement.name}.npz" for folder in synthetic]
            for clouds in map(read_clouds, files) if files else [movement.clouds]:
                joints = movement.joints[clouds.row] - place
                people[subject].append(pose_frames(clouds.frame, clouds.xyz, clouds.doppler, joints))
    return people


def simulated_step(data: Path, synthetic: Sequence[Path], subjects: Sequence[int]) -> int:
    """Real frames from one simulated frame to the next.

    Raises
    ------
    ValueError
        If the files differ in it.
    """
    names = [movement.name for subject in subjects for movement in read_subject(data, subject)]
    files = [folder / f"{name}.npz" for folder in synthetic for name in names]
    steps = {str(file): int(np.median(np.diff(read_clouds(file).row))) for file in files}
    if len(set(steps.values())) != 1:
        raise ValueError(f"frames are {steps} real ones apart: simulate all movements alike")
    return next(iter(steps.values()))


def _table(by_source: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    table: dict[str, Any] = {name: _summary(results) for name, results in by_source.items()}
    reference = table["real"]["S"]["mean"]
    table["S over that of real"] = {name: table[name]["S"]["mean"] / reference for name in by_source}
    return table


def _summary(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean of every figure over seeds, with the spread of single ones."""
    summary: dict[str, Any] = {}
    for key, value in results[0].items():
        values = [result[key] for result in results]
        if isinstance(value, Mapping):
            summary[key] = {
                name: {control: float(np.mean([item[name][control] for item in values])) for control in part}
                for name, part in value.items()
            }
        elif isinstance(value, list):
            summary[key] = np.mean(values, axis=0).round(3).tolist()
        else:
            summary[key] = {"mean": float(np.mean(values)), "std": float(np.std(values))}
    return summary


def _all(people: People) -> list[PoseFrames]:
    return [movement for movements in people.values() for movement in movements]


def _bodies(joints: NDArray[Any]) -> BodyEstimates:
    return BodyEstimates(joints=joints, root=joints[:, ROOT])


def _about_root(joints: NDArray[Any]) -> NDArray[Any]:
    return joints - joints[:, ROOT : ROOT + 1]


def _progress(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with mars/subjectN")
    parser.add_argument("--synthetic", type=Path, nargs="+", help="folders of experiments.mars.clouds")
    parser.add_argument("--pose", type=Path, default=POSE_FILE, help="pose of the radar, of experiments.mars.fit")
    parser.add_argument("--output", type=Path, required=True, help="JSON file")
    parser.add_argument("--subjects", type=int, nargs="+", default=[2, 3], help="people that networks are trained on")
    parser.add_argument("--test-subjects", type=int, nargs="+", help="people that are tested only")
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each kind")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--steps", type=int, default=TrainingPlan.steps, help="steps of each training")
    parser.add_argument("--kernel", type=int, default=1, help="frames of each of two convolutions over time")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args(argv)
    if not arguments.test_subjects and len(set(arguments.subjects)) < 2:
        parser.error(f"--subjects is {arguments.subjects}: name two or more, or others by --test-subjects")
    torch.set_num_threads(arguments.threads)
    begin = time.perf_counter()
    plan = TrainingPlan(arguments.steps, kernel=arguments.kernel)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    data, subjects, radar = arguments.data, arguments.subjects, read_pose(arguments.pose)
    real = read_people(data, subjects, radar)
    simulated = read_people(data, subjects, radar, arguments.synthetic) if arguments.synthetic else None
    sparse = arguments.synthetic and arguments.kernel > 1
    step = simulated_step(data, arguments.synthetic, subjects) if sparse else 1
    if arguments.test_subjects:
        test = read_people(data, arguments.test_subjects, radar)
        unseen = evaluate(real, simulated, test, seeds, plan, step)
    else:
        unseen = {}
        for subject in real:
            others, others_simulated = _without(real, subject), simulated and _without(simulated, subject)
            unseen |= evaluate(others, others_simulated, {subject: real[subject]}, seeds, plan, step)
    report = {
        "command": " ".join(["python", "-m", "experiments.mars.pose", *(sys.argv[1:] if argv is None else argv)]),
        "radar pose": vars(radar),
        "seeds": list(seeds),
        "steps": plan.steps,
        "unit": "cm",
        "kernel": plan.kernel,
        "frames apart": step,
        "frames": {
            "real": {str(subject): sum(map(len, part)) for subject, part in real.items()},
            "synthetic": {str(subject): sum(map(len, part)) for subject, part in (simulated or {}).items()},
        },
        "unseen people": unseen,
        "seen people": seen_people(real, seeds, plan),
        "paper's mae of seen people": PAPER_MAE_CM,
        "seconds": round(time.perf_counter() - begin, 1),
    }
    arguments.output.write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps(report, indent=1))


def _without(people: People, subject: int) -> dict[int, Sequence[PoseFrames]]:
    return {other: movements for other, movements in people.items() if other != subject}


if __name__ == "__main__":
    main()
