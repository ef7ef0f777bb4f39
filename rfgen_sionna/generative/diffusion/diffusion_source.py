"""Learned motion source: from words to a motion."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.generative.diffusion.checkpoint import MotionModel, read_model
from rfgen_sionna.generative.diffusion.constraints import (
    MotionConstraint,
    constrained_rows,
    leg_length,
    resampled_features,
)
from rfgen_sionna.generative.diffusion.drafts import (
    canonical_sentence,
    choose_hand,
    draft_beat,
    make_draft,
    sample_pace,
)
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, PARTS, arms_of, recentred, replace_parts
from rfgen_sionna.generative.diffusion.inpainting import LATEST, drafts_around_constraints, move_back
from rfgen_sionna.generative.diffusion.motion_sampling import (
    LONGEST,
    SHORTEST,
    SPARE,
    MotionRequest,
    MotionSampler,
    sample_in_segments,
    threads_for,
)
from rfgen_sionna.generative.diffusion.network import SOURCES
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, LOWER, UPPER, doing
from rfgen_sionna.generative.diffusion.postprocessing import RATE, to_motion
from rfgen_sionna.generative.diffusion.root_placement import free_placement, limit_speed, move_to_start
from rfgen_sionna.generative.diffusion.understanding import Understanding, ambiguous_actions, known_reading, understand
from rfgen_sionna.generative.motion import ACTIONS, MEAN_ADULT, Skeleton
from rfgen_sionna.generative.motion.kinematic import both_hands, check_hand
from rfgen_sionna.generative.motion.path_following import LONGER, check_path, follow_motion, follow_path, path_pace
from rfgen_sionna.records import Motion

_LOG = logging.getLogger(__name__)
MAX_DURATION = 120.0
"""Longest motion [s]; bounds memory."""
WALKS = ("walk", "walk_straight")
"""Actions that follow a path."""
REFINED = 0.9
"""Default noise level from which drafts are resampled; keeps their rhythm, changes their manner."""


@dataclass(frozen=True)
class DiffusionSource:
    """A :class:`~rfgen_sionna.generative.motion.MotionSource` trained on synthesised and captured motion.

    The model is loaded once, at first use.
    """

    weights: Path | None = None
    """Model file; None takes the shipped one."""
    sampler: MotionSampler = field(default_factory=MotionSampler)
    manner: str = "kinematic"
    """"kinematic" (clean, as synthesised), "mocap" (as captured) or "any"."""
    frame_rate: float = RATE
    """Poses per second of the result [Hz]."""
    refine: float | None = REFINED
    """Noise level (0 .. 1) from which a synthesised draft of the action is resampled. None samples from noise, as do
    captured actions and manners and `rhythm=False`. Given poses and parts always get a draft."""

    def __post_init__(self) -> None:
        if self.manner not in SOURCES:
            raise ValueError(f"manner: {self.manner!r}; allowed are {', '.join(SOURCES)}")
        if self.refine is not None and not 0.0 < self.refine <= 1.0:
            raise ValueError(f"refine: {self.refine!r}; allowed is more than 0 and at most 1, or None")
        if not (np.isfinite(self.frame_rate) and self.frame_rate > 0.0):
            raise ValueError(f"frame_rate: {self.frame_rate!r} Hz; allowed is a finite number above 0")
        if self.weights is not None and not Path(self.weights).is_file():
            raise FileNotFoundError(f"weights: no model file {self.weights}; None takes the one that ships")

    @property
    def model(self) -> MotionModel:
        """The trained model."""
        return _load(Path(self.weights or SHIPPED))

    @property
    def arms(self) -> tuple[str, ...]:
        """Arm actions that combine with those of :attr:`legs`."""
        return UPPER

    @property
    def legs(self) -> tuple[str, ...]:
        """The actions that leave the arms free for those of :attr:`arms`."""
        return LOWER

    def __call__(
        self,
        action: str,
        duration: float,
        seed: int,
        *,
        skeleton: Skeleton | None = None,
        hand: str | None = None,
        speed: float = 1.0,
    ) -> Motion:
        """A motion by action name; see :class:`~rfgen_sionna.generative.motion.MotionSource`.

        Raises:
            ValueError: the model does not have the action, or a value is out of range.
        """
        known = self.model.text.actions
        if action not in known:
            raise ValueError(f"action: {action!r} is unknown to the motion model; allowed are {', '.join(known)}")
        check_hand(hand, action)
        prompt = canonical_sentence(action, hand or choose_hand(action, "", seed))
        return self.generate(prompt, duration=duration, seed=seed, skeleton=skeleton, speed=speed, action=action)

    def read(self, prompt: str) -> Understanding:
        """Reading of a prompt.

        Raises:
            ValueError: the prompt has no words.
        """
        with threads_for(1):
            return understand(self.model.text, prompt, self.model.stems)

    def generate(
        self,
        prompt: str,
        *,
        duration: float = 6.0,
        seed: int = 0,
        negative: str = "",
        skeleton: Skeleton | None = None,
        speed: float = 1.0,
        rhythm: bool = True,
        keep: MotionConstraint | Sequence[MotionConstraint] = (),
        path: ArrayLike | None = None,
        action: str | None = None,
        arms: str = "",
    ) -> Motion:
        """A motion from words.

        Args:
            prompt: the movement, such as "a person walks while raising the left arm".
            duration: of the motion [s], at most 120.
            seed: of all random choices.
            negative: excluded movement.
            skeleton: of the person; None takes a mean adult.
            speed: factor on the usual pace of a repeated action.
            rhythm: whether a repeated action has a steady beat; otherwise the rhythm comes from noise.
            keep: given poses or parts of the body, at the result's place and time; a draft is placed around them.
            path: (point, 2) places on the floor [m] that a walk passes in `duration`, with rounded corners, facing
                ahead; 0.4 to 2.2 m/s. None leaves the path free.
            action: known meaning of the words, one of the model's actions; None takes the reading of the prompt.
            arms: action of the arms beside an action of :attr:`legs`, or empty.

        Raises:
            ValueError: a value is out of range, an action is unknown, `duration` is over 8 s with `keep`, `arms` do not
                combine with the action, or `path` is combined with an action that is no walk, a `speed` or a kept
                place.
        """
        return self.generate_many(
            [prompt],
            duration=duration,
            seeds=[seed],
            negative=negative,
            skeleton=skeleton,
            speed=speed,
            rhythm=rhythm,
            keep=keep,
            path=path,
            action=action,
            arms=arms,
        )[0]

    def generate_many(
        self,
        prompts: Sequence[str],
        *,
        duration: float = 6.0,
        seeds: Sequence[int] | None = None,
        negative: str = "",
        skeleton: Skeleton | None = None,
        speed: float = 1.0,
        rhythm: bool = True,
        keep: MotionConstraint | Sequence[MotionConstraint] = (),
        path: ArrayLike | None = None,
        action: str | None = None,
        arms: str = "",
    ) -> list[Motion]:
        """Several motions in one batch, which costs less than one by one; arguments as for :meth:`generate`."""
        if not (np.isfinite(duration) and 0.0 < duration <= MAX_DURATION):
            raise ValueError(f"duration: {duration!r} s; allowed is more than 0 and at most {MAX_DURATION:g} s")
        if not 0.5 <= speed <= 2.0:
            raise ValueError(f"speed: {speed!r}; allowed is a factor from 0.5 to 2")
        for name, value in (("action", action), ("arms", arms or None)):
            allowed = self.model.text.actions if name == "action" else UPPER
            if value is not None and value not in allowed:
                raise ValueError(f"{name}: {value!r} is unknown to the motion model; allowed are {', '.join(allowed)}")
        seeds = list(range(len(prompts))) if seeds is None else list(seeds)
        if len(seeds) != len(prompts) or not prompts:
            raise ValueError(f"seeds: {len(seeds)} given for {len(prompts)} prompts; allowed is one for each")
        for seed in seeds:
            _check_seed(seed)
        frames = int(np.ceil(duration * FRAME_RATE - 1e-9)) + 1
        keeps = [keep] if isinstance(keep, MotionConstraint) else list(keep)
        if keeps and frames > LONGEST + 1:
            raise ValueError(f"duration: {duration:g} s with keep; allowed are {LONGEST / FRAME_RATE:g} s")
        if arms and action not in LOWER:
            raise ValueError(f"arms: {arms!r} with the action {action!r}; allowed with {', '.join(LOWER)}")
        follow: Callable[[Motion], Motion] | None = None
        if path is not None:
            points = check_path(path, duration)
            if speed != 1.0:
                raise ValueError(
                    f"speed: {speed!r} with a path, whose length and duration give the speed; allowed is 1"
                )
            if kept := {"place", "pelvis"} & {part for each in keeps for part in each.parts}:
                raise ValueError(f"keep: {', '.join(sorted(kept))} with a path, which sets them; leave them free")
            longer = (skeleton or MEAN_ADULT).leg_length() / MEAN_ADULT.leg_length()
            speed = path_pace(points, duration * longer)
            follow = partial(follow_path, points=points, duration=duration, timed=not keeps)
            frames = frames if keeps else int(np.ceil(LONGER * duration * FRAME_RATE)) + 1
        with threads_for(len(prompts)):
            free = not keeps
            legs = untouched = None
            readings = [
                self._settled(self._meaning(prompt, action, arms, path is not None), seed, negative, drawn=free)
                for prompt, seed in zip(prompts, seeds, strict=True)
            ]
            # training data combine arms with "walk" only: sample arms of other actions separately
            separate = [k for k, said in enumerate(readings) if said.arms and said.action != "walk"]
            batch = [known_reading(said, said.action, "") if k in separate else said for k, said in enumerate(readings)]
            batch += [known_reading(readings[k], readings[k].arms, "") for k in separate]
            drafted, spare = rhythm and self.refine is not None, SPARE if free else LATEST
            requests = [
                self._request(said, seed, negative, frames, speed, rhythm, drafted=drafted, spare=spare)
                for said, seed in zip(batch, [*seeds, *(seeds[k] for k in separate)], strict=True)
            ]
            if not free:
                size = min(max(frames, SHORTEST), LONGEST)
                known, given = constrained_rows(keeps, self.model.hands, size)
                requests, begun = drafts_around_constraints(self.model, self.sampler, requests, known, given)
                legs, untouched = np.zeros(frames, bool), np.ones(frames, bool)
                legs[:size] = given[:frames, list(PARTS).index("legs")] == 1.0
                untouched[:size] = (given[:frames] != 1.0).all(axis=1)
            out = []
            if free:
                made = sample_in_segments(self.model, self.sampler, requests, frames, self.refine or 1.0)
            else:
                whole = sample_in_segments(self.model, self.sampler, requests, size, self.refine or REFINED)
                made = [move_back(each, first, frames) for each, first in zip(whole, begun, strict=True)]
            for k, rows in zip(separate, made[len(prompts) :], strict=True):
                said = readings[k]
                made[k] = replace_parts(made[k], rows, arms_of(said.arms, choose_hand(said.arms, said.hand, seeds[k])))
            for said, request, prompt, features in zip(readings, requests, prompts, made, strict=False):
                rows = free_placement(features) if free else limit_speed(features, untouched)
                motion = to_motion(
                    rows, self.model.hands, skeleton, self.frame_rate, free=free, legs=legs, follow=follow
                )
                if said.hand == "both":
                    hand = choose_hand(said.arms or said.action, "", request.seed)
                    motion = both_hands(motion, hand, still=not said.arms)
                out.append(replace(motion, prompt=prompt, seed=request.seed, action=request.action))
            return out

    def redo(
        self,
        draft: Motion,
        prompt: str,
        *,
        strength: float = 0.95,
        seed: int = 0,
        negative: str = "",
        skeleton: Skeleton | None = None,
    ) -> Motion:
        """A variation of a draft: noised to `strength` and resampled. Action, beat, heading and path stay.

        Args:
            draft: a motion with the body's joints, 1.6 to 8 s.
            prompt: movement of the draft.
            strength: noise level (0 .. 1) of the start; little changes below 0.85, and at 1 the path alone stays.
            seed: of the variation.
            negative: excluded movement.
            skeleton: of the person; None takes a mean adult. The path scales with the legs.

        Raises:
            ValueError: the draft is too short or too long, or a value is out of range.
        """
        _check_seed(seed)
        rows = resampled_features(draft, self.model.hands)
        if not SHORTEST <= len(rows) <= LONGEST + 1:
            low, high = SHORTEST / FRAME_RATE, LONGEST / FRAME_RATE
            raise ValueError(f"draft: {draft.duration:.2f} s long; allowed are {low:g} to {high:g} s")
        start = recentred(rows)[:LONGEST]
        with threads_for(1):
            said = self._settled(self._meaning(prompt, None, "", False), seed, negative, drawn=False)
            request = self._request(said, seed, negative, len(start), 1.0, False, drafted=False)
            request = replace(request, draft=start, beat=draft_beat(self.model, request, start))
            made = replace(self.sampler, strength=strength)(self.model, [request], len(start))[0]
        scale = (skeleton or MEAN_ADULT).leg_length() / leg_length(draft)
        follow = partial(follow_motion, other=draft, scale=scale)
        motion = to_motion(move_to_start(made, rows), self.model.hands, skeleton, self.frame_rate, follow=follow)
        return replace(motion, prompt=prompt, seed=seed, action=draft.action or said.action)

    def _meaning(self, prompt: str, action: str | None, arms: str, on_path: bool) -> Understanding:
        """Reading of a prompt with a known action, or of a walk along a path."""
        said = self.read(prompt)
        if action is not None:
            said = known_reading(said, action, arms)
        if on_path and said.action not in WALKS:
            raise ValueError(f"path: {prompt!r} means '{said.action}'; allowed is a walk")
        for sentence in said.warnings:
            _LOG.warning(sentence)
        return known_reading(said, "walk_straight", said.arms) if on_path else said

    def _settled(self, said: Understanding, seed: int, negative: str, *, drawn: bool) -> Understanding:
        """The reading with its alternatives decided by the negative prompt, and from the seed if `drawn`."""
        arms = said.arms if said.action in LOWER else ""
        left = said.alternatives if drawn and said.known else []
        if negative.strip():
            denied = self.read(negative)
            left = ambiguous_actions(said, denied)
            for sentence in denied.warnings:
                _LOG.warning(sentence.replace("prompt:", "negative:", 1))
            if not left and denied.action == said.action:
                _LOG.warning("negative: %r excludes the action of %r itself, and has no effect", negative, said.prompt)
        if len(left) > 1 or (negative.strip() and left):
            shares = np.array([share for _, share in left])
            chosen = int(np.random.default_rng([seed, 29]).choice(len(left), p=shares / shares.sum()))
            action = left[chosen][0]
            said = replace(said, action=action, rephrase=True)
        hand = said.hand
        gesture = ACTIONS.get(arms or said.action)
        if hand == "both" and (gesture is None or "both" not in gesture.hands):
            hand = ""
        return replace(said, arms=arms if said.action in LOWER else "", hand=hand)

    def _request(
        self,
        said: Understanding,
        seed: int,
        negative: str,
        frames: int,
        speed: float,
        rhythm: bool,
        *,
        drafted: bool,
        spare: int = SPARE,
    ) -> MotionRequest:
        action, arms = said.action, said.arms
        if said.hand == "both":  # mirrored afterwards
            said = replace(said, hand=choose_hand(arms or action, "", seed), rephrase=True)
        # unknown or misread words are replaced by a plain sentence
        words = _plain_sentence(said) if said.rephrase or (action in CLAUSES and not said.known) else said.prompt
        beat = None
        if rhythm and action in self.model.beats:
            rng = np.random.default_rng([seed, 23])
            beat = self.model.beats[action].draw(frames + LONGEST, FRAME_RATE, rng, speed * said.pace)
        manner = self.manner if action in CLAUSES else "mocap"
        request = MotionRequest(words, seed, negative, beat, action=action, source=manner)
        if not drafted or manner != "kinematic":
            return request
        size = frames + LONGEST if frames > LONGEST else max(frames, SHORTEST) + spare
        rows = make_draft(
            (action, arms) if arms else (action,),
            size,
            seed,
            self.model.hands,
            hand=said.hand,
            speed=sample_pace(seed, speed * said.pace),
        )
        return replace(request, draft=rows, beat=draft_beat(self.model, request, rows))


def _check_seed(seed: int) -> None:
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed: {seed!r}; a whole number of at least 0 is needed")


def _plain_sentence(said: Understanding) -> str:
    plain = canonical_sentence(said.action, said.hand if said.action in ACTIONS and ACTIONS[said.action].hands else "")
    return f"{plain} while {doing(said.arms, said.hand)}" if said.arms else plain


SHIPPED = Path(__file__).with_name("weights") / "motion.safetensors"


@lru_cache(maxsize=4)
def _load(path: Path) -> MotionModel:
    return read_model(path)
