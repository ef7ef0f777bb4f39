"""Motions of any length: stretch by stretch, each going on where the last one stopped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.features import PARTS, heading, recentred, turned
from rfgen_sionna.generative.diffusion.motion_sampling import LONGEST, SHORTEST, MotionRequest, MotionSampler
from rfgen_sionna.generative.diffusion.root_placement import move_to_start

SPARE = 8
"""Frames that drafts and beats go on for, because the network takes lengths in steps of this."""
_OVERLAP = 40
"""Poses that a stretch shares with the one before it ..."""
_FADE = 8
"""... and over how many of them, the last ones, one passes into the other."""


def sample_in_segments(
    model: MotionModel, sampler: MotionSampler, requests: Sequence[MotionRequest], frames: int, strength: float
) -> list[FloatArray]:
    """(frame, NUM_FEATURES) of each wish.

    Args:
        model: the trained model.
        sampler: how the reverse process is run.
        wishes: beats and drafts of them last as long as the motion, and `SPARE` frames.
        frames: of each motion.
        strength: noise level from which drafts are made anew.
    """
    drafted = [w.draft is not None for w in requests]
    if any(drafted) and not all(drafted):
        # the two start at different noise
        made: dict[int, FloatArray] = {}
        for kind in (True, False):
            at = [k for k, d in enumerate(drafted) if d is kind]
            made |= zip(
                at, sample_in_segments(model, sampler, [requests[k] for k in at], frames, strength), strict=True
            )
        return [made[k] for k in range(len(requests))]
    if all(drafted):
        sampler = replace(sampler, strength=strength)
    size = min(max(frames, SHORTEST), LONGEST)
    done = [np.asarray(r) for r in sampler(model, [_part(w, 0, size) for w in requests], size)]
    fade = np.clip((_OVERLAP - np.arange(_OVERLAP)) / (_FADE + 1.0), 0.0, 1.0)[:, None]
    while len(done[0]) < frames:
        start = len(done[0]) - _OVERLAP
        more = []
        for request, rows in zip(requests, done, strict=True):
            before = recentred(rows[start:])
            known = np.zeros((LONGEST, before.shape[1]))
            known[:_OVERLAP] = before
            given = np.zeros((LONGEST, len(PARTS)))
            given[: _OVERLAP - _FADE] = 1.0
            part = _part(request, start, LONGEST)
            if part.draft is not None:
                # the draft goes on from where the motion has got to
                joint_frame = _OVERLAP - _FADE
                draft = turned(recentred(part.draft, joint_frame), float(heading(before)[joint_frame]))
                draft[:, :2] += before[joint_frame, :2]
                part = replace(part, draft=draft)
            more.append(replace(part, known=known, given=given, seed=request.seed + start))
        for k, rows in enumerate(sampler(model, more, LONGEST)):
            new, old = move_to_start(rows, done[k][start:]), done[k][start:]
            new[:_OVERLAP] += fade * (old - new[:_OVERLAP])
            done[k] = np.concatenate([done[k][:start], new])
    return [rows[:frames] for rows in done]


def _part(request: MotionRequest, start: int, frames: int) -> MotionRequest:
    stop = start + frames + SPARE
    beat = None if request.beat is None else request.beat[start:stop]
    draft = None if request.draft is None else recentred(request.draft[start:stop])
    return replace(request, beat=beat, draft=draft)
