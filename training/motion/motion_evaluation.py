"""The model's examination: generated motion beside real, as figures and pictures."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.constraints import resampled_features
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, encode
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.motion import ACTIONS, MEAN_ADULT
from rfgen_sionna.records import Motion
from training.learning import Progress
from training.motion import motion_metrics as metrics
from training.motion.body_exam import on_bodies, repeats
from training.motion.exam_prompts import AMBIGUOUS, OUTSIDE, PARAPHRASES
from training.motion.kinematic_clips import Clip
from training.motion.motion_captions import caption
from training.motion.motion_corpus import MotionCorpus
from training.motion.motion_metrics import rhythm_score
from training.motion.originality import against_captured, originality
from training.motion.recogniser import ActionClassifier, train_action_classifier

DURATION = 6.0
FRAMES = int(DURATION * FRAME_RATE) + 1
PERIODIC = tuple(a for a in CLAUSES if ACTIONS[a].periodic)
RHYTHMIC = tuple(a for a in PERIODIC if a not in ("walk", "pick_up", "click", "finger_swing"))
"""Those whose real motion shows it to the score, which sees no fingers, no long periods and stumbles over turns."""
PARTS = ("paraphrases", "negative prompts", "captured", "originality", "bodies")
"""What is noted beside the actions."""
Note = Callable[[str], None]


@dataclass(frozen=True)
class Reference:
    """Real motion that the generator hasn't seen, apart from what the judge was trained on."""

    kinematic: dict[str, list[FloatArray]]
    """Action -> feature rows."""
    captured: list[tuple[str, str, FloatArray]]
    """(action, caption, feature rows) of windows of captured clips."""
    classifier: ActionClassifier


def reference(
    fresh: Sequence[Clip], corpus: MotionCorpus, *, seed: int = 0, progress: Progress | None = None
) -> Reference:
    """Train the judge on what was held out of the training set, and keep other unseen motion to compare with.

    Args:
        fresh: synthesised clips of another seed than the training set's, to compare with.
        corpus: its held-out synthesised clips teach the judge; of its held-out captured clips, half do, and half are
            for comparing.
        seed: of the judge.
        progress: called with (steps of its training done, steps, loss).
    """
    kinematic: dict[str, list[FloatArray]] = {}
    rows: list[FloatArray] = []
    labels: list[str] = []
    for clip in fresh:
        kinematic.setdefault(clip.action, []).append(encode(clip.motion, corpus.hands)[:FRAMES])
    for entry in corpus.entries:
        if entry.held_out and entry.source == "kinematic" and len(entry.actions) == 1:
            rows.append(entry.features.astype(np.float64))
            labels.append(entry.actions[0])
    captured = []
    windows = [
        (e.actions[0], e.captions[0], e.features[s : s + FRAMES].astype(np.float64))
        for e in corpus.entries
        if e.source == "mocap" and e.held_out and len(e.features) >= 60
        for s in range(0, max(1, len(e.features) - FRAMES + 1), FRAMES // 2)
    ]
    for k, (action, sentence, features) in enumerate(windows):
        if k % 2:
            captured.append((action, sentence, features))
        else:
            rows.append(features)
            labels.append(action if action in CLAUSES else f"captured {action}")
    return Reference(kinematic, captured, train_action_classifier(rows, labels, seed=seed, progress=progress))


def examine(
    source: DiffusionSource, real: Reference, corpus: MotionCorpus, *, each: int = 12, seed: int = 0, note: Note = print
) -> dict[str, Any]:
    """All figures for one seed.

    Args:
        source: what is examined.
        real: what it is compared with.
        corpus: its training set, for the check against copies.
        each: motions of an action.
        seed: of prompts and motions.
        note: called with a line of progress.
    """
    made, out = examine_actions(source, real, each=each, seed=seed, note=note)
    rng = np.random.default_rng([seed, 43])
    note("paraphrases")
    out |= _paraphrases(source, real, rng)
    note("negative prompts")
    out |= _negatives(source, real, rng)
    out["outside the vocabulary, warned"] = float(np.mean([not source.read(p).known for p in OUTSIDE]))
    note("captured")
    out |= _captured(source, real, corpus, rng)
    note("originality")
    rows = {a: [resampled_features(m, source.model.hands) for m in group] for a, group in made.items()}
    out |= originality(rows, real.kinematic, corpus)
    note("bodies")
    return out | on_bodies(source, seed) | repeats(source)


def examine_actions(
    source: DiffusionSource, real: Reference, *, each: int = 12, seed: int = 0, note: Note = print
) -> tuple[dict[str, list[Motion]], dict[str, Any]]:
    """The motions of every action asked for in words of the training, and the figures that they alone decide."""
    rng = np.random.default_rng([seed, 41])
    made: dict[str, list[Motion]] = {}
    for action in CLAUSES:
        prompts = [_seen(rng, action, ("left", "right")[k % 2]) for k in range(each)]
        made[action] = source.generate_many(prompts, duration=DURATION, seeds=_seeds(rng, each))
        note(action)
    return made, {"seed": seed, "motions of an action": each, **_named(source, real, made)}


def compare(source: DiffusionSource, real: Reference, made: dict[str, list[Motion]]) -> dict[str, Any]:
    """Figures of motions by action that need no prompts: rhythm, distance, variance, jerk, slide, limits."""
    rows = {a: [resampled_features(m, source.model.hands) for m in group] for a, group in made.items()}
    actions = list(rows)
    ours, floor = _distances(real, rows)
    ratio = {a: metrics.variance(rows[a]) / metrics.variance(real.kinematic[a]) for a in actions}
    slide = {a: [metrics.foot_slide(m, MEAN_ADULT) for m in group] for a, group in made.items()}
    beaten = [a for a in actions if a in PERIODIC]
    clear = [a for a in beaten if a in RHYTHMIC]
    jerk = [np.mean([metrics.mean_jerk(m) for a in actions for m in group[a]]) for group in (rows, real.kinematic)]
    return {
        "rhythm, where real motion has it": float(
            np.mean([rhythm_score(m, FRAME_RATE) for a in clear for m in rows[a]])
        ),
        "rhythm": float(np.mean([rhythm_score(m, FRAME_RATE) for a in beaten for m in rows[a]])),
        "rhythm, real": float(np.mean([rhythm_score(m, FRAME_RATE) for a in beaten for m in real.kinematic[a]])),
        "rhythm by action": {
            a: [float(np.mean([rhythm_score(m, FRAME_RATE) for m in g[a]])) for g in (rows, real.kinematic)]
            for a in beaten
        },
        "Fréchet distance over floor, kinematic": ours / floor,
        "Fréchet floor, kinematic": floor,
        "least variance ratio": float(min(ratio.values())),
        "variance ratio by action": ratio,
        "jerk ratio": float(jerk[0] / jerk[1]),
        "foot slide [m/s]": float(np.nanmean([s for group in slide.values() for s in group])),
        "foot slide walking [m/s]": float(np.nanmean(slide["walk"] + slide["walk_straight"]))
        if "walk" in slide
        else None,
        "poses out of joint limits": float(np.mean([metrics.out_of_limits(m) for g in made.values() for m in g])),
    }


def _distances(real: Reference, rows: dict[str, list[FloatArray]]) -> tuple[float, float]:
    """Fréchet distance of made to real motion, and of real to other real: as many of each action in every set."""
    rng = np.random.default_rng(0)
    each = min(min(len(g) for g in rows.values()), min(len(real.kinematic[a]) for a in rows) // 2)
    classify = {a: (real.classifier.classify(rows[a])[0], real.classifier.classify(real.kinematic[a])[0]) for a in rows}
    ours, floor = [], []
    for _ in range(5):
        made, first, second = [], [], []
        for mine, true in classify.values():
            made.append(mine[rng.permutation(len(mine))[:each]])
            order = rng.permutation(len(true))
            first.append(true[order[:each]])
            second.append(true[order[each : 2 * each]])
        a, b, c = (np.concatenate(x) for x in (made, first, second))
        ours.append(metrics.frechet(a, b))
        floor.append(metrics.frechet(b, c))
    return float(np.mean(ours)), float(np.mean(floor))


def _named(source: DiffusionSource, real: Reference, made: dict[str, list[Motion]]) -> dict[str, Any]:
    out = compare(source, real, made)
    right = {a: _hits(source, real, a, group) for a, group in made.items()}
    truth = {a: np.mean([n == a for n in real.classifier.name(g)]) for a, g in real.kinematic.items()}
    return {
        "recognised, seen wording": float(np.mean([h for group in right.values() for h in group])),
        "worst action, seen wording": _worst(right),
        "recognised, real": float(np.mean(list(truth.values()))),
        **out,
    }


def _paraphrases(source: DiffusionSource, real: Reference, rng: np.random.Generator) -> dict[str, Any]:
    right = {}
    for action, prompts in PARAPHRASES.items():
        many = list(prompts)
        motions = source.generate_many(many, duration=DURATION, seeds=_seeds(rng, len(many)))
        right[action] = _hits(source, real, action, motions)
    every = [h for group in right.values() for h in group]
    return {"recognised, paraphrases": float(np.mean(every)), "worst action, paraphrases": _worst(right)}


def _negatives(source: DiffusionSource, real: Reference, rng: np.random.Generator) -> dict[str, Any]:
    complied = {}
    for prompt, negative, ruled_out in AMBIGUOUS:
        motions = source.generate_many([prompt] * 6, duration=DURATION, seeds=_seeds(rng, 6), negative=negative)
        hits = _hits(source, real, ruled_out, motions)
        complied[f"{prompt} / {negative}"] = 1.0 - float(np.mean(hits))
    return {"negative prompts complied with": float(np.mean(list(complied.values()))), "negative prompts": complied}


def _captured(
    source: DiffusionSource, real: Reference, corpus: MotionCorpus, rng: np.random.Generator
) -> dict[str, Any]:
    """Windows asked for by the captions of the held-out captured windows, against those windows."""
    if len(real.captured) < 16:
        return {}
    made = []
    for start in range(0, len(real.captured), 16):
        prompts = [sentence for _, sentence, _ in real.captured[start : start + 16]]
        made += source.generate_many(prompts, duration=DURATION, seeds=_seeds(rng, len(prompts)))
    rows = [resampled_features(m, source.model.hands) for m in made]
    classify, _ = real.classifier.classify(rows)
    true, _ = real.classifier.classify([f for _, _, f in real.captured])
    half = len(true) // 2
    floor = metrics.frechet_floor(true, half, rng)
    far = np.mean(
        [
            metrics.frechet(classify[rng.permutation(len(classify))[:half]], true[rng.permutation(len(true))[:half]])
            for _ in range(5)
        ]
    )
    return {
        "Fréchet distance over floor, captured": float(far) / floor,
        "Fréchet floor, captured": floor,
        "jerk ratio, captured": float(
            np.mean([metrics.mean_jerk(m) for m in rows]) / np.mean([metrics.mean_jerk(f) for _, _, f in real.captured])
        ),
        "foot slide, captured [m/s]": float(np.nanmean([metrics.foot_slide(m, MEAN_ADULT) for m in made])),
        "windows, captured": len(true),
        "distance to the nearest captured clip over that of unseen captured ones": against_captured(
            {"captured": _long(rows)}, {"captured": _long([f for _, _, f in real.captured])}, corpus
        ).get("captured"),
    }


def _long(rows: Sequence[FloatArray]) -> list[FloatArray]:
    """Those of two seconds at least."""
    return [r for r in rows if len(r) >= 2 * FRAME_RATE]


def _hits(source: DiffusionSource, real: Reference, action: str, motions: Sequence[Motion]) -> list[bool]:
    names = real.classifier.name([resampled_features(m, source.model.hands) for m in motions])
    return [name == action for name in names]


def _seen(rng: np.random.Generator, action: str, hand: str) -> str:
    hand = hand if ACTIONS[action].one_handed else ""
    said = caption(rng, (action,), hand=hand, doubt=0.0)
    # left and right as often as in the real motion that it is compared with
    if not hand or re.search(rf"{hand} (hand|arm|palm|index|fore)", said):
        return said
    return f"{said.rstrip('.')} with the {hand} hand"


def _seeds(rng: np.random.Generator, count: int) -> list[int]:
    return [int(s) for s in rng.integers(2**31, size=count)]


def _worst(right: dict[str, list[bool]]) -> dict[str, float]:
    missed = Counter({a: 1.0 - float(np.mean(h)) for a, h in right.items()})
    return {a: 1.0 - m for a, m in missed.most_common(3)}
