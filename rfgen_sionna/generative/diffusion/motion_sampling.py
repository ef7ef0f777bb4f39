"""Reverse process: features from noise or from a noised draft; long motions in overlapping segments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import torch
from scipy.signal import butter, sosfiltfilt
from torch import Tensor

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.blending import blend_transitions
from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.constraints import SOFT, spread
from rfgen_sionna.generative.diffusion.features import (
    CONTACTS,
    FRAME_RATE,
    NUM_FEATURES,
    PARTS,
    heading,
    recentred,
    turned,
)
from rfgen_sionna.generative.diffusion.network import PAIR, SOURCES, STRIDE, Conditions, Corrector
from rfgen_sionna.generative.diffusion.root_placement import move_to_start
from rfgen_sionna.generative.diffusion.schedule import log_snr, make_scheduler, signal_shares, step_at
from rfgen_sionna.generative.diffusion.sentence_encoder import tokenise
from rfgen_sionna.generative.motion import ACTIONS
from rfgen_sionna.parallel import one_blas_thread

SHORTEST, LONGEST = 32, 160
"""Range of frames of one sample."""
GESTURES = ("swipe_left", "swipe_right", "push", "pull", "circle_clockwise", "circle_counterclockwise", "click",
            "finger_swing")  # fmt: skip
"""One-handed actions of a standing person."""
CUTOFFS = MappingProxyType({"kinematic": 6.0, "mocap": 8.5, "any": 6.0})
"""Manner -> cut-off of the low-pass on the result [Hz]; captured people and their markers shake faster."""
STILL_CUTOFF = 2.5
"""Cut-off for still body parts [Hz]: the whole body in postures, all but the working arm in gestures."""
SMALL = 16
"""Batch size up to which one thread is fastest: layers take less than a millisecond."""
SPARE = 8
"""Extra frames of drafts and beats: the network's lengths are multiples of this number."""
_OVERLAP = 40
"""Frames of a segment's overlap with the previous one ..."""
_FADE = 8
"""... and of its cross-fade, at its end."""


@dataclass(frozen=True)
class MotionRequest:
    """Request for one motion."""

    prompt: str
    seed: int
    negative: str = ""
    beat: FloatArray | None = None
    """(frame, 3), see :mod:`rfgen_sionna.generative.diffusion.rhythm`; None leaves the rhythm free."""
    known: FloatArray | None = None
    """(frame, NUM_FEATURES) given features in their own units; None gives none."""
    given: FloatArray | None = None
    """(frame, part) 1 where `known` holds, 0 elsewhere."""
    draft: FloatArray | None = None
    """(frame, NUM_FEATURES) start of the reverse process; None starts from noise."""
    action: str = ""
    """Action, for the correction of its residual."""
    source: str = "kinematic"
    """Manner: "kinematic", "mocap" or "any"."""


@dataclass(frozen=True)
class MotionSampler:
    """Options of the reverse process."""

    kind: str = "ddim"
    """"ddim" or "dpm"."""
    steps: int = 16
    guidance: float = 2.0
    """1 follows the prompt as learned, more exaggerates it; static poses collapse above 3."""
    strength: float = 1.0
    """Noise level from which a draft is resampled; little changes below 0.85."""
    cutoff: float | None = None
    """Cut-off of the low-pass on the result [Hz]; None takes that of the manner, `CUTOFFS`."""

    def __post_init__(self) -> None:
        make_scheduler(self.kind)
        if not 2 <= self.steps <= 200:
            raise ValueError(f"steps: {self.steps}; allowed are 2 to 200")
        if not 0.0 <= self.guidance <= 10.0:
            raise ValueError(f"guidance: {self.guidance}; allowed is 0 to 10")
        if not 0.0 < self.strength <= 1.0:
            raise ValueError(f"strength: {self.strength}; allowed is more than 0 and at most 1")
        if self.cutoff is not None and not 0.0 < self.cutoff < 0.5 * FRAME_RATE:
            raise ValueError(f"cutoff: {self.cutoff} Hz; allowed is more than 0 and less than {0.5 * FRAME_RATE:g}")

    @torch.no_grad()
    def __call__(self, model: MotionModel, requests: Sequence[MotionRequest], frames: int) -> FloatArray:
        """(motion, frame, NUM_FEATURES) features in their own units.

        Args:
            model: the trained model.
            requests: one for each motion; results are independent of each other up to rounding.
            frames: of each motion, from `SHORTEST` to `LONGEST`.

        Raises:
            ValueError: `frames` is out of range, or only some requests have drafts.
        """
        if not SHORTEST <= frames <= LONGEST:
            raise ValueError(f"frames: {frames}; allowed are {SHORTEST} to {LONGEST}")
        block = PAIR * STRIDE
        padded = -(-frames // block) * block
        conditions = conditions_of(model, requests, padded)
        known, hard = conditions.known, _hard(conditions.given)
        noise = torch.stack(
            [
                torch.randn(padded, NUM_FEATURES, generator=torch.Generator().manual_seed(_mixed(w.seed)))
                for w in requests
            ]
        )
        scheduler = make_scheduler(self.kind)
        scheduler.set_timesteps(self.steps)
        timesteps = [int(t) for t in scheduler.timesteps]
        x = noise
        if any(w.draft is not None for w in requests):
            start = step_at(self.strength) if self.strength < 1.0 else timesteps[0]
            timesteps, x = self._from_draft(model, scheduler, requests, start, noise, padded)
        clean = x
        shares = signal_shares()
        correct = Corrector(
            [model.residuals.get(w.action) if w.source == "kinematic" else None for w in requests], padded
        )
        level = torch.from_numpy(log_snr(signal_shares())).float()
        for t in timesteps:
            clean = self.guess(model, x, level[t], conditions)
            clean = correct(clean, x, float(shares[t]))
            clean = torch.where(hard > 0.0, known, clean)
            x = scheduler.step(clean, t, x).prev_sample
        # the last guess, without the scheduler's remaining noise
        rows = _joined(clean.double().numpy()[:, :frames] * model.scale + model.mean, requests)
        smooth = np.empty_like(rows)
        for source in {w.source for w in requests}:
            at = [k for k, w in enumerate(requests) if w.source == source]
            smooth[at] = low_pass(rows[at], CUTOFFS[source] if self.cutoff is None else self.cutoff)
        if self.cutoff is None:
            for k, request in enumerate(requests):
                calm = still_columns(request)
                smooth[k][:, calm] = low_pass(rows[k : k + 1], STILL_CUTOFF)[0][:, calm]
        kept = (hard > 0.0).numpy()[:, :frames]
        # the low-pass changes the ends of given poses
        return _joined(np.where(kept, known.double().numpy()[:, :frames] * model.scale + model.mean, smooth), requests)

    def guess(self, model: MotionModel, x: Tensor, level: Tensor, conditions: Conditions) -> Tensor:
        """Guided guess of the clean motions."""
        n = len(x)
        if self.guidance == 1.0:
            return model.net(x, level.expand(n), conditions)
        both = _doubled(conditions)
        free, guided = model.net(torch.cat([x, x]), level.expand(2 * n), both).chunk(2)
        return free + self.guidance * (guided - free)

    def _from_draft(
        self,
        model: MotionModel,
        scheduler: Any,
        requests: Sequence[MotionRequest],
        start: int,
        noise: Tensor,
        padded: int,
    ) -> tuple[list[int], Tensor]:
        """Steps of the scheduler from `start` down, and the noised drafts."""
        drafts = []
        for request in requests:
            if request.draft is None:
                raise ValueError("draft: only some requests have one; sample the others separately")
            drafts.append(padded_rows(((request.draft - model.mean) / model.scale), padded))
        draft = torch.from_numpy(np.stack(drafts)).float()
        all_steps = [int(t) for t in scheduler.timesteps]
        # nearest step of the schedule, which keeps its arithmetic exact
        first = int(np.argmin([abs(t - start) for t in all_steps]))
        if hasattr(scheduler, "set_begin_index"):
            scheduler.set_begin_index(first)
        share = float(signal_shares()[all_steps[first]])
        return all_steps[first:], np.sqrt(share) * draft + np.sqrt(1.0 - share) * noise


def low_pass(rows: FloatArray, cutoff: float) -> FloatArray:
    """(motion, frame, feature) rows low-passed at `cutoff` [Hz] without delay; contacts stay unchanged."""
    sos = butter(4, cutoff, fs=FRAME_RATE, output="sos")
    out = sosfiltfilt(sos, rows, axis=1, padlen=min(15, rows.shape[1] - 1))
    out[..., CONTACTS] = rows[..., CONTACTS]
    return np.asarray(out, np.float64)


def still_columns(request: MotionRequest) -> list[int]:
    """Columns of still body parts of a synthesised action, without contacts."""
    if request.source != "kinematic" or request.known is not None or request.action not in ACTIONS:
        return []
    parts = [part for part in PARTS if not part.endswith("arm")]
    if not ACTIONS[request.action].periodic:
        parts = list(PARTS)
    elif request.action not in GESTURES:
        return []
    elif request.draft is not None:
        draft = request.draft
        parts.append(min(("left_arm", "right_arm"), key=lambda arm: float(draft[:, PARTS[arm]].std(axis=0).max())))
    return [c for part in parts for c in PARTS[part] if not CONTACTS.start <= c < CONTACTS.stop]


def conditions_of(model: MotionModel, requests: Sequence[MotionRequest], frames: int) -> Conditions:
    """Conditions of a batch of requests, padded to `frames`."""
    wanted = model.text(tokenise([w.prompt for w in requests]))
    unwanted = model.text(tokenise([w.negative for w in requests])).pooled
    said = torch.tensor([bool(w.prompt.strip()) for w in requests])[:, None]
    denied = torch.tensor([bool(w.negative.strip()) for w in requests])[:, None]
    beats = np.zeros((len(requests), frames, 3))
    given = np.zeros((len(requests), frames, len(PARTS)))
    known = np.zeros((len(requests), frames, NUM_FEATURES))
    for i, request in enumerate(requests):
        if request.beat is not None:
            beats[i] = padded_rows(request.beat, frames)
        if request.known is not None and request.given is not None:
            n = len(request.known)
            given[i, :n] = request.given
            known[i, :n] = (request.known - model.mean) / model.scale * spread(request.given)
    return Conditions(
        wanted.tokens * said[..., None],
        wanted.mask,
        wanted.pooled * said,
        unwanted * denied,
        torch.tensor([SOURCES.index(w.source) for w in requests]),
        torch.from_numpy(beats).float(),
        torch.from_numpy(known).float(),
        torch.from_numpy(given).float(),
    )


def _doubled(c: Conditions) -> Conditions:
    """The conditions twice, first without words."""
    each = {field.name: getattr(c, field.name) for field in fields(c)}
    wordless = each | {name: torch.zeros_like(each[name]) for name in ("tokens", "pooled", "unwanted")}
    return Conditions(**{name: torch.cat([wordless[name], each[name]]) for name in each})


def _joined(rows: FloatArray, requests: Sequence[MotionRequest]) -> FloatArray:
    """(motion, frame, NUM_FEATURES) rows whose free intervals continue the given ones."""
    for own, request in zip(rows, requests, strict=True):
        if request.given is not None and (request.given == 1.0).any():
            own[:] = blend_transitions(own, request.given[: len(own)] == 1.0)
    return rows


def _hard(given: Tensor) -> Tensor:
    """(motion, frame, NUM_FEATURES) 1 for exactly given features."""
    exact = (given > SOFT).double().numpy()
    return torch.from_numpy(np.stack([spread(g) for g in exact])).float()


def padded_rows(rows: FloatArray, frames: int) -> FloatArray:
    """Rows cut to `frames`, or padded with copies of the last one."""
    if len(rows) >= frames:
        return rows[:frames]
    return np.concatenate([rows, np.repeat(rows[-1:], frames - len(rows), axis=0)])


def _mixed(seed: int) -> int:
    """Seed that differs strongly for neighbouring seeds."""
    return int(np.random.SeedSequence([seed, 31]).generate_state(1)[0])


@contextmanager
def threads_for(motions: int) -> Iterator[None]:
    """Context in which PyTorch computes up to `SMALL` motions on one thread, without busy waiting of the others."""
    before = torch.get_num_threads()
    if motions > SMALL or before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        with one_blas_thread():
            yield
    finally:
        torch.set_num_threads(before)


def sample_in_segments(
    model: MotionModel, sampler: MotionSampler, requests: Sequence[MotionRequest], frames: int, strength: float
) -> list[FloatArray]:
    """(frame, NUM_FEATURES) rows of each request.

    Args:
        model: the trained model.
        sampler: options of the reverse process.
        requests: with beats and drafts of the motion's length and `SPARE` frames.
        frames: of each motion.
        strength: noise level from which drafts are resampled.
    """
    drafted = [w.draft is not None for w in requests]
    if any(drafted) and not all(drafted):
        # different initial noise
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
                # the draft continues from the end of the motion
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
