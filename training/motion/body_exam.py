"""What is measured on bodies that perform generated motion: feet on the floor, limbs in the trunk."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies import Phenotype, Rig, animate, person
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.drafts import canonical_sentence
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.records import Motion
from training.motion.intersections import buried_faces

_DURATION = 4.0
_LOOKS = (0.4, 1.5, 2.6, 3.7)
"""Instants at which bodies are looked into [s]."""
_STEP = 0.2
"""Time between those at which feet are [s]."""
_ENDS = ("hand", "forearm", "foot")
"""Parts that no fold of the skin at hip, knee or armpit reaches."""


def on_bodies(source: DiffusionSource, seed: int) -> dict[str, Any]:
    """Figures of one motion of every action on one body, beside synthesised ones on the same body."""
    rig = person(Phenotype(gender=("female", "male")[seed % 2]), seed=seed)
    prompts = [canonical_sentence(a) for a in CLAUSES]
    made = source.generate_many(prompts, duration=_DURATION, seeds=[seed] * len(prompts), skeleton=rig.skeleton)
    real = [KinematicSource()(a, _DURATION, seed, skeleton=rig.skeleton) for a in CLAUSES]
    ours, theirs = ([_inside(rig, m) for m in group] for group in (made, real))
    feet, hands = (np.concatenate([_lowest(rig, m, parts) for m in made]) for parts in ("foot", "hand"))
    out: dict[str, Any] = {
        "planted feet over the floor, rms [m]": float(np.sqrt(np.mean(feet**2))),
        "planted feet within 1 cm of the floor": float(np.mean(np.abs(feet) <= 0.01)),
        "planted feet farthest from the floor [m]": float(np.abs(feet).max()),
        "hands under the floor at most [m]": float(max(-hands.min(), 0.0)),
        "skin inside the body, at rest": _shares(rig, rig.vertices)[0],
        "skin inside the body by action (generated, synthesised)": {
            a: [float(x[0]), float(y[0])] for a, x, y in zip(CLAUSES, ours, theirs, strict=True)
        },
    }
    for name, group in (("", ours), (", synthesised", theirs)):
        whole, ends = np.mean(group, axis=0)
        out[f"skin inside the body{name}"] = float(whole)
        out[f"skin of hands, forearms and feet inside the body{name}"] = float(ends)
    return out


def repeats(source: DiffusionSource) -> dict[str, bool]:
    """Whether seeds decide motions."""
    prompts = [canonical_sentence(a) for a in ("walk", "push", "t_pose")]
    first, again, other = (
        np.stack([m.rotations for m in source.generate_many(prompts, duration=3.0, seeds=seeds)])
        for seeds in ([5, 6, 7], [5, 6, 7], [8, 9, 10])
    )
    apart = np.abs(first - other).reshape(len(prompts), -1).max(axis=1)
    return {
        "same seed, same motion": bool((first == again).all()),
        "other seed, other motion": bool((apart > 0.01).all()),
    }


def _inside(rig: Rig, motion: Motion) -> FloatArray:
    """(2,) mean share of the skin, and of that of hands, forearms and feet over the whole, that is inside the body."""
    sequence = animate(rig, motion)
    return np.mean([_shares(rig, sequence.vertices(t)) for t in _LOOKS], axis=0)


def _shares(rig: Rig, vertices: FloatArray) -> tuple[float, float]:
    corners = vertices[rig.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    buried = buried_faces(vertices, rig.faces)
    ends = np.isin(rig.face_parts, [k for k, part in enumerate(rig.part_names) if part.endswith(_ENDS)])
    return float(area[buried].sum() / area.sum()), float(area[buried & ends].sum() / area.sum())


def _lowest(rig: Rig, motion: Motion, part: str) -> FloatArray:
    """(instant,) height of the lowest vertex of both feet or hands [m] where a foot is planted."""
    sequence = animate(rig, motion)
    times = np.arange(0.0, motion.duration, _STEP)
    planted = motion.contacts
    if planted is not None:
        times = times[planted[np.round(times * motion.frame_rate).astype(int)].any(axis=1)]
    mine = [k for k, name in enumerate(rig.part_names) if name.endswith(part)]
    vertices = np.unique(rig.faces[np.isin(rig.face_parts, mine)])
    return np.array([sequence.vertices(t)[vertices, 2].min() for t in times])
