"""Drafts around given poses: what comes before and after them as the action would, and where it would.

From noise alone the network begins at its own origin, wherever the given poses are, and gets to them in a jump.
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

_WHERE = [list(PARTS).index(part) for part in ("place", "pelvis")]
LATEST = 60
"""Frames by which a draft may be late at most, for its pose to be near to the given one where the two meet."""


def drafts_around_constraints(
    model: MotionModel, sampler: MotionSampler, requests: Sequence[MotionRequest], known: FloatArray, given: FloatArray
) -> tuple[list[MotionRequest], list[FloatArray]]:
    """The wishes with given poses and drafts around them, all moved to where motions begin for the network.

    Args:
        model, sampler: draw a draft where a wish has none.
        wishes: their drafts are longer than the motion by up to `LATEST`.
        known: (frame, NUM_FEATURES) what is given.
        given: (frame, part) where it is.

    Returns:
        the wishes, and of each the first row of its draft in the given poses' own place, see :func:`move_back`.
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
    """(frame, NUM_FEATURES) what is given, and the draft before, between and after it, turned and shifted to it.

    Args:
        draft: (frame or more, NUM_FEATURES) the action; each free stretch takes what of it is nearest where they meet.
        known: (frame, NUM_FEATURES) what is given.
        given: (frame, part) where it is. Where place or pelvis are not, the draft stays where it is.
    """
    fixed = (given[:, _WHERE] == 1.0).all(axis=1)
    here = spread((given == 1.0).astype(np.float64)) > 0.0
    out = draft[: len(known)].copy()
    for k in np.flatnonzero(fixed).tolist():  # parts that are not given move along with those that are
        out[k] = _moved_to(out[k : k + 1], 0, known[k])[0]
    if fixed.any():
        edges = np.flatnonzero(np.diff(np.concatenate([[True], fixed, [True]]).astype(np.int8))).reshape(-1, 2)
        latest = min(LATEST, len(draft) - len(known))
        for start, stop in edges.tolist():
            at = start - 1 if start > 0 else stop  # the given pose that the stretch begins after, or ends before
            late = _nearest(draft[at : at + latest + 1], known[at], here[at])
            out[start:stop] = _moved_to(draft, at + late, known[at])[start + late : stop + late]
    return np.where(here, known, out)


def _nearest(rows: FloatArray, pose: FloatArray, here: NDArray[np.bool_]) -> int:
    """Which row has the pose that is nearest to a given one, of which the columns `here` count."""
    poses = np.concatenate([recentred(rows[k : k + 1]) for k in range(len(rows))])
    columns = [c for c in (2, *range(TURN.start, TRACKED_POSITIONS.stop)) if here[c]]
    away = poses[:, columns] - recentred(pose[None])[:, columns]
    return int(np.argmin((away**2).sum(axis=1)))


def _moved_to(draft: FloatArray, joint_frame: int, pose: FloatArray) -> FloatArray:
    """The draft turned and shifted so that at `joint_frame` it is where a pose is, and heads where that does."""
    out = turned(recentred(draft, joint_frame), float(heading(pose[None])[0]))
    out[:, :2] += pose[:2] - out[joint_frame, :2]
    return out


def move_back(rows: FloatArray, first: FloatArray, frames: int) -> FloatArray:
    """(frames, NUM_FEATURES) rows that begin at the origin, moved to where the draft's `first` (NUM_FEATURES,) was; one
    more than there are goes straight on."""
    if len(rows) < frames:
        onward = 2.0 * rows[-1:] - rows[-2:-1]
        onward[:, CONTACTS] = rows[-1:, CONTACTS]
        rows = np.concatenate([rows, onward])
    out = turned(rows[:frames], float(heading(first[None])[0]))
    out[:, :2] += first[:2]
    return out
