"""Drafts around given poses: what comes before and after them as the action would, and where it would.

From noise alone the network begins at its own origin, wherever the given poses are, and gets to them in a jump.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.drafts import beat_of
from rfgen_sionna.generative.diffusion.features import LOCAL, PARTS, PLACES, TURN, heading, recentred, turned
from rfgen_sionna.generative.diffusion.sampling import LONGEST, Sampler, Wish, padded_rows
from rfgen_sionna.records import FloatArray

_WHERE = [list(PARTS).index(part) for part in ("place", "pelvis")]
LATEST = 60
"""Frames by which a draft may be late, for its pose to be near to the given one where the two meet; it is that much
longer than the motion."""


def drafted_around(
    model: MotionModel, sampler: Sampler, wishes: Sequence[Wish], known: FloatArray, given: FloatArray
) -> tuple[list[Wish], list[FloatArray]]:
    """The wishes with given poses and drafts around them, all moved to where motions begin for the network.

    Args:
        model, sampler: draw a draft where a wish has none.
        wishes: their drafts are longer than the motion by `LATEST`.
        known: (frame, NUM_FEATURES) what is given.
        given: (frame, part) where it is.

    Returns:
        the wishes, and of each the first row of its draft in the given poses' own place, see :func:`moved_back`.
    """
    frames, long = len(known), len(known) + LATEST
    free = [w for w in wishes if w.draft is None]
    drawn = iter(sampler(model, free, min(long, LONGEST)) if free else ())
    out, first = [], []
    for wish in wishes:
        draft = padded_rows(next(drawn) if wish.draft is None else wish.draft, long)
        rows = around(draft, known, given)
        moved = known.copy()
        moved[:, :2] -= rows[0, :2]
        moved = turned(moved, -float(heading(rows[:1])[0]))
        start = recentred(rows)
        begun = replace(wish, known=moved, given=given, draft=start)
        out.append(begun if wish.beat is None else replace(begun, beat=beat_of(model, begun, start[:frames])))
        first.append(rows[0])
    return out, first


def around(draft: FloatArray, known: FloatArray, given: FloatArray) -> FloatArray:
    """(frame, NUM_FEATURES) the given poses, and the draft before, between and after them, turned and shifted to them.

    Args:
        draft: (frame + LATEST, NUM_FEATURES) the action; each free stretch takes what of it is nearest where they meet.
        known: (frame, NUM_FEATURES) what is given.
        given: (frame, part) where it is; where place or pelvis are not, the draft stays as it is.
    """
    frames = len(known)
    fixed = (given[:, _WHERE] == 1.0).all(axis=1)
    if not fixed.any():
        return draft[:frames]
    out = np.where(fixed[:, None], known, 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], fixed, [True]]).astype(np.int8))).reshape(-1, 2)
    for start, stop in edges.tolist():
        at = start - 1 if start > 0 else stop  # the given pose that the stretch begins after, or ends before
        late = _nearest(draft, known[at], at)
        out[start:stop] = _moved_to(draft, at + late, known[at])[start + late : stop + late]
    return out


def _nearest(draft: FloatArray, pose: FloatArray, at: int) -> int:
    """By how many frames the draft is best late for its pose at frame `at` to be a given one."""
    wanted = _shape(recentred(pose[None]))
    away = [
        np.sum((_shape(recentred(draft[k : k + 1])) - wanted) ** 2) for k in range(at, min(at + LATEST, len(draft)))
    ]
    return int(np.argmin(away))


def _shape(rows: FloatArray) -> FloatArray:
    """What of (frame, NUM_FEATURES) rows is a pose: heights and places count in metres, rotations as much."""
    return np.concatenate([rows[:, 2:3], rows[:, TURN], rows[:, LOCAL], rows[:, PLACES]], axis=1)


def _moved_to(draft: FloatArray, seam: int, pose: FloatArray) -> FloatArray:
    """The draft turned and shifted so that at `seam` it is where a pose is, and heads where that does."""
    out = turned(recentred(draft, seam), float(heading(pose[None])[0]))
    out[:, :2] += pose[:2] - out[seam, :2]
    return out


def moved_back(rows: FloatArray, first: FloatArray) -> FloatArray:
    """Rows that begin at the origin, moved to where the `first` (NUM_FEATURES,) of the draft was."""
    out = turned(rows, float(heading(first[None])[0]))
    out[:, :2] += first[:2]
    return out
