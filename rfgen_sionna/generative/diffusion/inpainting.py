"""Drafts around given poses: the action before, between and after them, in their place.

From noise alone the network starts at its own origin, away from the given poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.constraints import spread
from rfgen_sionna.generative.diffusion.drafts import draft_beat
from rfgen_sionna.generative.diffusion.features import (
    CONTACTS,
    PARTS,
    TRACKED_POSITIONS,
    TURN,
    heading,
    recentred,
    turned,
)
from rfgen_sionna.generative.diffusion.motion_sampling import LONGEST, MotionRequest, MotionSampler
from rfgen_sionna.generative.motion.resampling import runs

_WHERE = [list(PARTS).index(part) for part in ("place", "pelvis")]
LATEST = 60
"""Largest delay of a draft [frames] in search of a pose near the given one."""


def drafts_around_constraints(
    model: MotionModel, sampler: MotionSampler, requests: Sequence[MotionRequest], known: FloatArray, given: FloatArray
) -> tuple[list[MotionRequest], list[FloatArray]]:
    """Requests with given poses and drafts around them, moved to the network's origin.

    Args:
        model, sampler: sample a draft for requests without one.
        requests: drafts are up to `LATEST` frames longer than the motion.
        known: (frame, NUM_FEATURES) given features.
        given: (frame, part) mask of them.

    Returns:
        the requests, and the first row of each draft before the move, for :func:`move_back`.
    """
    free = [w for w in requests if w.draft is None]
    drawn = iter(sampler(model, free, min(len(known) + LATEST, LONGEST)) if free else ())
    out, first = [], []
    for request in requests:
        rows = draft_around(next(drawn) if request.draft is None else request.draft, known, given)
        moved = known.copy()
        moved[:, :2] -= rows[0, :2]
        moved = turned(moved, -float(heading(rows[:1])[0]))
        begun = replace(request, known=moved, given=given, draft=recentred(rows))
        out.append(begun if request.beat is None else replace(begun, beat=draft_beat(model, begun, recentred(rows))))
        first.append(rows[0])
    return out, first


def draft_around(draft: FloatArray, known: FloatArray, given: FloatArray) -> FloatArray:
    """(frame, NUM_FEATURES) given rows, and the draft before, between and after them, turned and shifted to them.

    Args:
        draft: (frame or more, NUM_FEATURES) the action; each free interval takes its part that is nearest at the joint.
        known: (frame, NUM_FEATURES) given features.
        given: (frame, part) mask of them. The draft stays where place or pelvis are free.
    """
    fixed = (given[:, _WHERE] == 1.0).all(axis=1)
    here = spread((given == 1.0).astype(np.float64)) > 0.0
    out = draft[: len(known)].copy()
    for k in np.flatnonzero(fixed).tolist():  # free parts move along
        out[k] = _moved_to(out[k : k + 1], 0, known[k])[0]
    if fixed.any():
        latest = min(LATEST, len(draft) - len(known))
        for start, stop in runs(~fixed):
            at = start - 1 if start > 0 else stop  # given pose at the joint
            late = _nearest(draft[at : at + latest + 1], known[at], here[at])
            out[start:stop] = _moved_to(draft, at + late, known[at])[start + late : stop + late]
    return np.where(here, known, out)


def _nearest(rows: FloatArray, pose: FloatArray, here: NDArray[np.bool_]) -> int:
    """Index of the row nearest to a pose, by the columns `here`."""
    poses = np.concatenate([recentred(rows[k : k + 1]) for k in range(len(rows))])
    columns = [c for c in (2, *range(TURN.start, TRACKED_POSITIONS.stop)) if here[c]]
    away = poses[:, columns] - recentred(pose[None])[:, columns]
    return int(np.argmin((away**2).sum(axis=1)))


def _moved_to(draft: FloatArray, joint_frame: int, pose: FloatArray) -> FloatArray:
    """The draft turned and shifted to a pose at `joint_frame`."""
    out = turned(recentred(draft, joint_frame), float(heading(pose[None])[0]))
    out[:, :2] += pose[:2] - out[joint_frame, :2]
    return out


def move_back(rows: FloatArray, first: FloatArray, frames: int) -> FloatArray:
    """(frames, NUM_FEATURES) rows from the origin, moved to a draft's `first` row (NUM_FEATURES,); a missing last row
    is extrapolated."""
    if len(rows) < frames:
        onward = 2.0 * rows[-1:] - rows[-2:-1]
        onward[:, CONTACTS] = rows[-1:, CONTACTS]
        rows = np.concatenate([rows, onward])
    out = turned(rows[:frames], float(heading(first[None])[0]))
    out[:, :2] += first[:2]
    return out
