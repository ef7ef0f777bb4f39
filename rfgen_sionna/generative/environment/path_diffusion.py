"""Path diffusion: completes traced images by gains on existing energy and by new energy in empty pixels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.classifier import ConfidenceGate
from rfgen_sionna.generative.environment.conditional_prior import LatentPrior
from rfgen_sionna.generative.environment.environment_model import condition_of
from rfgen_sionna.generative.environment.image_generation import view_facts
from rfgen_sionna.generative.environment.image_models import EmbeddedImageModel, load_embedded
from rfgen_sionna.generative.environment.image_sampling import (
    MOST_STEPS,
    Conditioning,
    ImageSampler,
    noise_like,
    sample_images,
)
from rfgen_sionna.generative.environment.reprojection import NATIVE, PATCH, resize_pir
from rfgen_sionna.generative.environment.requested_objects import OUTDOORS, check_words
from rfgen_sionna.generative.environment.torch_device import memory_errors
from rfgen_sionna.generative.prompts.scene_prompt import check_seed
from rfgen_sionna.pir.image_surroundings import check_image
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir

STEPS, GUIDANCE, SAMPLES = 2, 1.0, 6
"""Default drawing: few steps and the mean of a few samples have the least error."""
MOST_GAIN_DB = 15.0
"""Largest change of existing energy."""
CHANGED_DB, CHANGED_RANGE = 3.0, 0.3
"""Changes of a pixel's level and range [m] between frames below which it is static."""
_FILLED = ImageSampler("ddim", 10, 1.0)
"""Sampler for empty pixels."""
_BATCH = 32
"""Drawings at once; bounds memory."""
_FLOOR_DB = -300.0
"""Level of no energy."""


@dataclass(frozen=True)
class _FrameEstimate:
    """The model's estimate for one frame, at its own resolution."""

    gain: FloatArray
    """(row, column) [dB]; 0 for empty pixels."""
    level: FloatArray
    """(row, column) new energy [dB]; `_FLOOR_DB` for none."""
    arrival: FloatArray
    """(row, column) time of arrival of the new energy [s]."""


class PathDiffusion:
    """Completes mixed images (traced body, traced or imagined surroundings).

    Parameters
    ----------
    model, control
        The environment model and its ControlNet, files or folders; None takes the shipped ones.
    lora
        RF LoRA of the environment model; None adds none.
    device
        "cpu", "cuda", …; None takes CUDA where available.
    steps, guidance, sampler
        Of the drawing. With a negative prompt guidance is at least 1.5, since it has no effect at 1.
    samples
        Drawings that are averaged.
    most_gain_db
        Largest change of existing energy.
    judged
        Whether the confidence gate leaves complete images unchanged; False applies all gains.
    half, compile
        As in :class:`~rfgen_sionna.generative.environment.environment_diffusion.EnvironmentDiffusion`.

    Raises
    ------
    ValueError
        If an argument is out of its range, or there is no such device.
    FileNotFoundError, ModelFileError, LoraError
        If a file is missing or unreadable, or does not fit the model.
    """

    def __init__(
        self,
        model: str | Path | None = None,
        control: str | Path | None = None,
        lora: str | Path | None = None,
        device: str | None = None,
        *,
        steps: int = STEPS,
        guidance: float = GUIDANCE,
        sampler: str = "ddim",
        samples: int = SAMPLES,
        most_gain_db: float = MOST_GAIN_DB,
        judged: bool = True,
        half: bool | None = None,
        compile: bool = False,
    ) -> None:
        if not 1 <= samples <= 64:
            raise ValueError(f"samples: {samples!r}; 1 … 64 are allowed")
        if not (math.isfinite(most_gain_db) and most_gain_db >= 0):
            raise ValueError(f"most_gain_db: {most_gain_db!r}; a finite level [dB] of at least 0 is needed")
        self.sampler = ImageSampler(sampler, steps, guidance)
        own = load_embedded(
            model, lora, device, control=True if control is None else Path(control), half=half, compiled=compile
        )
        self.backend = EmbeddedImageModel(own)
        self.samples, self.most_gain_db = samples, most_gain_db
        known = own.confidence_gate or ConfidenceGate()
        self.confidence_gate = known if judged else ConfidenceGate(known.share)
        spread = own.control_facts.get("spread")
        self.spread = None if spread is None else torch.tensor(spread)[:, None, None]

    def refine(self, mixed: Pir, prompt: str, *, negative: str = "", strength: float = 1.0, seed: int = 0) -> Pir:
        """One completed image; see :meth:`refine_sequence`."""
        return self.refine_sequence([mixed], prompt, negative=negative, strength=strength, seed=seed)[0]

    def refine_sequence(
        self,
        frames: Sequence[Pir],
        prompt: str,
        *,
        negative: str = "",
        strength: float = 1.0,
        seed: int = 0,
        progress: Callable[[int, int], None] | None = None,
    ) -> list[Pir]:
        """Coherently completed images of one view over time.

        Existing energy is multiplied by a bounded gain; its time of arrival and velocity stay. Empty pixels may gain
        static energy; in rooms, which are closed on all sides, all of them do. Complete images hardly change
        (:class:`~rfgen_sionna.generative.environment.classifier.ConfidenceGate`). All frames share their noise. A
        static pixel has a constant gain, hence no Doppler; all moving pixels share one gain, which keeps their phases.

        Parameters
        ----------
        frames
            Mixed images, of one view.
        prompt, negative
            Description of the surroundings, and absent objects.
        strength
            0 returns the frames; up to 1, the initial noise of the drawing. Between the noise levels of the steps,
            gains are scaled down.
        seed
            Of the noise.
        progress
            Called with (frames done, frames); None reports nothing.

        Raises
        ------
        TypeError, ValueError
            If the frames' views differ, a value is impossible for a radar image, or an argument is out of its range.
        PromptError
            If the words contradict each other
            (:func:`~rfgen_sionna.generative.environment.requested_objects.check_words`).
        DeviceMemoryError
            If the device runs out of memory.
        """
        if isinstance(strength, bool) or not isinstance(strength, (int, float, np.number)) or not 0 <= strength <= 1:
            raise ValueError(f"strength: {strength!r}; 0 … 1 is allowed")
        check_words(prompt, negative)
        check_seed(seed)
        if not frames:
            raise ValueError("frames: none are given")
        for number, frame in enumerate(frames):
            check_image(f"frames[{number}]", frame)
        views = [View.of(frame) for frame in frames]
        if any(view != views[0] for view in views):
            raise ValueError("frames: their views differ; refine each view by itself")
        self.backend.check_view(views[0])
        if strength == 0:
            return list(frames)
        small = [resize_pir(frame, NATIVE) for frame in frames]
        guesses: list[_FrameEstimate] = []
        for start in range(0, len(frames), max(1, _BATCH // self.samples)):
            part = small[start : start + max(1, _BATCH // self.samples)]
            guesses += self._guess(part, prompt, negative, strength, int(seed))
            if progress is not None:
                progress(len(guesses), len(frames))
        channels = np.stack([self.backend.model.codec.encode(frame, clip=True) for frame in small])
        confidence = self.confidence_gate(channels, [view_facts(views[0])] * len(small))
        if self.backend.model.text.place_of(prompt)[0] not in OUTDOORS:
            guesses = [self._filled(*each, prompt, int(seed)) for each in zip(small, guesses, strict=True)]
        confidence *= strength / self._noise(strength)
        held = _held(small, [replace(guess, gain=confidence * guess.gain) for guess in guesses])
        common = _common(small, held)
        return [self._applied(frame, guess, common, strength) for frame, guess in zip(frames, held, strict=True)]

    def _noise(self, strength: float) -> float:
        """Initial share of the schedule: the smallest from `strength` on that the steps can run."""
        steps = self.sampler.steps
        return steps / min(MOST_STEPS, int(steps / strength + 1e-9))

    def _guess(
        self, frames: Sequence[Pir], prompt: str, negative: str, strength: float, seed: int
    ) -> list[_FrameEstimate]:
        model, codec = self.backend.model, self.backend.model.codec
        device = str(model.unet.device)
        channels = np.stack([codec.encode(frame, clip=True) for frame in frames])
        tokens, against = self.backend.tokens(prompt, negative, View.of(frames[0]))
        noise = self._noise(strength)
        sampler = replace(self.sampler, steps=round(self.sampler.steps / noise))
        if negative.strip() and sampler.guidance < 1.5:
            sampler = replace(sampler, guidance=1.5)
        many = len(frames) * self.samples
        with memory_errors(device):
            start = torch.cat([self.backend.encode(frame) for frame in frames])
        begun = start.repeat_interleave(self.samples, 0)
        drawn = sample_images(
            model,
            self.backend.scheduler,
            sampler,
            tokens.repeat(many, 1, 1),
            against.repeat(many, 1, 1),
            noise_like(self.samples, model, seed).repeat(len(frames), 1, 1, 1),
            Conditioning(
                condition_of(channels).repeat_interleave(self.samples, 0),
                begun,
                noise + 1e-9,
                expected=None if self.spread is None else LatentPrior(begun, self.spread.expand(begun.shape)),
            ),
        )
        with torch.no_grad(), memory_errors(device):
            kept = model.vae.decode(start).sample.float().clamp(-1, 1).cpu().numpy()
        drawn = drawn.reshape(len(frames), self.samples, *drawn.shape[1:])
        return [self._compare(frame, old, new) for frame, old, new in zip(frames, kept, drawn, strict=True)]

    def _filled(self, frame: Pir, guess: _FrameEstimate, prompt: str, seed: int) -> _FrameEstimate:
        """The estimate with energy in all empty pixels of a room, drawn around the others."""
        empty = (frame.energy <= 0).reshape(NATIVE[0] // PATCH, PATCH, NATIVE[1] // PATCH, PATCH).any(axis=(1, 3))
        if not empty.any():
            return guess
        model, many = self.backend.model, self.samples
        with memory_errors(str(model.unet.device)):
            known = self.backend.encode(frame).repeat(many, 1, 1, 1)
        tokens, against = (each.repeat(many, 1, 1) for each in self.backend.tokens(prompt, "", View.of(frame)))
        drawn = sample_images(
            model,
            self.backend.scheduler,
            _FILLED,
            tokens,
            against,
            noise_like(many, model, seed),
            Conditioning(known=known, keep=torch.from_numpy(~empty)[None, None]),
        )
        votes, level, when = self._mean(drawn)
        new = (frame.energy <= 0) & (votes > 0.5)
        return replace(guess, level=np.where(new, level, guess.level), arrival=np.where(new, when, guess.arrival))

    def _mean(self, drawn: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(row, column) share of the drawings (sample, 3, row, column) with a return, and their mean level [dB] and
        arrival [s]."""
        energy, arrival, _ = self.backend.model.codec.decode_arrays(drawn, clip=True)
        there = energy > 0
        count = np.maximum(there.sum(axis=0), 1)
        level = np.where(there, _decibels(energy), 0.0).sum(axis=0) / count
        return there.mean(axis=0), level, np.where(there, np.nan_to_num(arrival), 0.0).sum(axis=0) / count

    def _compare(self, frame: Pir, old: FloatArray, new: FloatArray) -> _FrameEstimate:
        """Gains of drawings (sample, 3, row, column) over the autoencoder's reconstruction of the frame."""
        codec = self.backend.model.codec
        before, _, _ = codec.decode_arrays(old, clip=True)
        votes, level, when = self._mean(new)
        was = frame.energy > 0
        known = was & (before > 0) & (votes > 0)
        gain = np.where(known, level - _decibels(before), 0.0)
        appears = ~was & (votes > 0.5)
        return _FrameEstimate(
            np.clip(gain, -self.most_gain_db, self.most_gain_db),
            np.where(appears, level, _FLOOR_DB),
            np.where(appears, when, np.nan),
        )

    def _applied(self, frame: Pir, guess: _FrameEstimate, common: float, strength: float) -> Pir:
        """`frame` with an estimate's gains, `strength` times its new energy, and the gain `common` of all moving pixels
        [dB]."""
        rows, columns = frame.energy.shape
        where = np.meshgrid(
            (np.arange(rows) + 0.5) * NATIVE[0] / rows - 0.5,
            (np.arange(columns) + 0.5) * NATIVE[1] / columns - 0.5,
            indexing="ij",
        )
        gain = np.where(frame.velocity != 0, common, map_coordinates(guess.gain, where, order=1, mode="nearest"))
        nearest = tuple(np.clip(np.rint(w), 0, NATIVE[k] - 1).astype(np.intp) for k, w in enumerate(where))
        added = (frame.energy <= 0) & (guess.level[nearest] > _FLOOR_DB)
        share = strength * NATIVE[0] * NATIVE[1] / (rows * columns)
        energy = np.where(added, share * 10 ** (guess.level[nearest] / 10), frame.energy * 10 ** (gain / 10))
        return replace(
            frame,
            energy=energy,
            time_of_arrival=np.where(added, guess.arrival[nearest], frame.time_of_arrival),
            velocity=np.where(added, 0.0, frame.velocity),
        )


def _held(frames: Sequence[Pir], guesses: Sequence[_FrameEstimate]) -> list[_FrameEstimate]:
    """Estimates in which each pixel has one gain, and one new energy, for each interval in which it is static."""
    if len(frames) < 2:
        return list(guesses)
    levels = np.stack([_decibels(frame.energy) for frame in frames])
    reach = np.stack([0.5 * SPEED_OF_LIGHT * np.nan_to_num(frame.time_of_arrival) for frame in frames])
    still = (np.abs(np.diff(levels, axis=0)) < CHANGED_DB) & (np.abs(np.diff(reach, axis=0)) < CHANGED_RANGE)
    still &= np.stack([frame.velocity == 0 for frame in frames]).all(axis=0)
    interval = np.concatenate([np.zeros((1, *NATIVE), np.intp), np.cumsum(~still, axis=0)])
    label = (interval * NATIVE[0] * NATIVE[1] + np.arange(NATIVE[0] * NATIVE[1]).reshape(NATIVE)).ravel()
    gain = _means(np.stack([g.gain for g in guesses]), label)
    new = np.stack([g.level > _FLOOR_DB for g in guesses])
    share = _means(new.astype(np.float64), label)
    level = _means(np.where(new, np.stack([g.level for g in guesses]), 0.0), label) / np.maximum(share, 1e-9)
    when = _means(np.where(new, np.stack([np.nan_to_num(g.arrival) for g in guesses]), 0.0), label)
    there = share > 0.5
    return [
        _FrameEstimate(
            gain[k],
            np.where(there[k], level[k], _FLOOR_DB),
            np.where(there[k], when[k] / np.maximum(share[k], 1e-9), np.nan),
        )
        for k in range(len(frames))
    ]


def _common(frames: Sequence[Pir], guesses: Sequence[_FrameEstimate]) -> float:
    """Gain [dB] of all moving pixels: energy-weighted mean over pixels and frames."""
    gain, weight = (np.stack(each) for each in ([g.gain for g in guesses], [_moving(frame) for frame in frames]))
    return float((gain * weight).sum() / max(float(weight.sum()), np.finfo(np.float64).tiny))


def _moving(frame: Pir) -> FloatArray:
    """(row, column) energy of moving pixels."""
    return np.where((frame.velocity != 0) & (frame.energy > 0), frame.energy, 0.0)


def _means(values: FloatArray, label: NDArray[np.intp]) -> FloatArray:
    """`values`, each replaced by the mean over its label."""
    count = np.bincount(label)
    sums = np.bincount(label, weights=values.ravel())
    return np.asarray((sums / np.maximum(count, 1))[label].reshape(values.shape))


def _decibels(energy: FloatArray) -> FloatArray:
    return np.asarray(10 * np.log10(np.maximum(energy, 1e-30)))
