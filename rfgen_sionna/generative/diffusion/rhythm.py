"""Rhythm of a motion: period, phase, and beat.

The model is conditioned on a beat (cosine and sine of the phase at each pose), taken from the clip in training and
drawn from the action's statistics for sampling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import HANDS, LOCAL, PARTS, heading, joint_positions
from rfgen_sionna.generative.motion.curves import wander
from rfgen_sionna.generative.motion.skeleton import JOINT

SHORTEST, LONGEST = 0.35, 3.6
"""Range of periods of the search [s]."""
_TREND = 3.6
"""Period above which movement is drift [s]."""
TRAVEL_SPEED = 0.25
"""Mean speed of the pelvis above which the rhythm is that of the steps [m/s]."""
LONGEST_STRIDE = 1.9
"""Longest period of two steps [s]."""
_REACH = 0.08
"""Lever arm of a wrist turn or a finger bend [m]."""


def relative_positions(features: FloatArray) -> FloatArray:
    """(frame, 66) joint positions from the pelvis in the frame of its heading, and the pelvis' height [m]."""
    places = joint_positions(features)
    yaw = heading(features)
    c, s = np.cos(yaw), np.sin(yaw)
    local = places - places[:, :1]
    x = c[:, None] * local[..., 0] + s[:, None] * local[..., 1]
    y = -s[:, None] * local[..., 0] + c[:, None] * local[..., 1]
    out = np.stack([x, y, local[..., 2]], axis=-1)
    out[:, 0, 2] = places[:, 0, 2]
    return out.reshape(len(features), -1)


def movement(features: FloatArray, rate: float) -> FloatArray:
    """(frame, k) movement: joint positions from the pelvis [m], wrist turns and fingers, without slow drift."""
    # the wrist is the last of an arm's four joints
    wrists = [
        c for part in ("left_arm", "right_arm") for c in [c for c in PARTS[part] if LOCAL.start <= c < LOCAL.stop][18:]
    ]
    hands = list(range(HANDS.start, HANDS.stop))
    positions = np.concatenate([relative_positions(features), _REACH * features[:, wrists + hands]], axis=1)
    if len(positions) < 3:
        return positions - positions.mean(axis=0)
    width = min(max(3, round(_TREND * rate)), len(positions))
    return positions - uniform_filter1d(positions, width, axis=0, mode="nearest")


def stride(features: FloatArray, rate: float) -> FloatArray | None:
    """(frame,) position of the left ankle before the right [m]; None for a person who does not travel."""
    # averaged over a second: sway is no travel
    smooth = uniform_filter1d(features[:, :2], max(1, round(rate)), axis=0, mode="nearest")
    path = np.linalg.norm(np.diff(smooth, axis=0), axis=-1)
    if len(path) < 3 or path.mean() * rate < TRAVEL_SPEED:
        return None
    positions = relative_positions(features).reshape(len(features), -1, 3)
    return np.asarray(positions[:, JOINT["left_ankle"], 0] - positions[:, JOINT["right_ankle"], 0], np.float64)


def principal_direction(moving: FloatArray) -> FloatArray:
    """(k,) unit direction of largest variance of the rows of a (frame, k) array."""
    _, _, rows = np.linalg.svd(moving.T @ moving)
    return np.asarray(rows[0], np.float64)


def autocorrelation(signal: FloatArray, lags: int) -> FloatArray:
    """(lags,) autocorrelation, normalised at each lag."""
    s = signal - signal.mean()
    out = np.zeros(lags)
    for k in range(min(lags, len(s) - 2)):
        a, b = s[: len(s) - k], s[k:]
        out[k] = np.dot(a, b) / max(float(np.sqrt(np.dot(a, a) * np.dot(b, b))), 1e-12)
    return out


def find_period(signal: FloatArray, rate: float, longest: float = LONGEST) -> tuple[float, float]:
    """Period [s] and its autocorrelation (0 .. 1) of a (frame,) signal; (0, 0) without one."""
    last = min(int(longest * rate) + 2, int(0.67 * len(signal)))
    first = int(SHORTEST * rate)
    if last - first < 4 or np.ptp(signal) < 1e-6:
        return 0.0, 0.0
    r = autocorrelation(signal, last)
    peaks = [k for k in range(first, last - 1) if r[k] >= r[k - 1] and r[k] > r[k + 1]]
    if not peaks:
        return 0.0, 0.0
    best = max(r[k] for k in peaks)
    if best <= 0.0:
        return 0.0, 0.0
    k = next(k for k in peaks if r[k] >= 0.92 * best)
    curvature = r[k - 1] - 2.0 * r[k] + r[k + 1]
    shift = 0.5 * (r[k - 1] - r[k + 1]) / curvature if abs(curvature) > 1e-9 else 0.0
    return (k + float(np.clip(shift, -0.5, 0.5))) / rate, float(np.clip(r[k], 0.0, 1.0))


def find_phase(signal: FloatArray, rate: float, period: float) -> FloatArray:
    """(frame,) phase [rad] of the fundamental of a signal of about this period [s]; 0 at its crests, unwrapped."""
    t = np.arange(len(signal)) / rate
    carrier = np.exp(-2j * np.pi * t / period)
    half = max(2, round(0.9 * period * rate))
    window = np.hanning(2 * half + 1)
    pad = np.zeros(half)
    s = np.concatenate([pad, (signal - signal.mean()) * carrier, pad])
    z = np.convolve(s, window, "valid")
    return 2.0 * np.pi * t / period + np.unwrap(np.angle(z))


@dataclass(frozen=True)
class Beat:
    """Statistics of an action's repetition."""

    log_rate: float
    """Mean of ln(repetitions per second)."""
    spread: float
    """Its standard deviation over people."""
    jitter: float
    """Relative rms drift of one person's rate."""

    def draw(self, frames: int, frame_rate: float, rng: np.random.Generator, speed: float = 1.0) -> FloatArray:
        """(frame, 3) cosine and sine of a drawn phase, and ones."""
        rate = float(np.exp(self.log_rate + self.spread * np.clip(rng.standard_normal(), -2.0, 2.0))) * speed
        t = np.arange(frames) / frame_rate
        steps = rate * (1.0 + np.clip(wander(t, rng, self.jitter, 0.1, 0.5), -0.2, 0.2))
        phase = 2.0 * np.pi * (rng.uniform() + np.cumsum(steps) / frame_rate)
        return np.stack([np.cos(phase), np.sin(phase), np.ones(frames)], axis=-1)


def beat_rows(phase: FloatArray | None, frames: int) -> FloatArray:
    """(frame, 3) cosine, sine and 1; zeros for a phase of None."""
    if phase is None:
        return np.zeros((frames, 3))
    return np.stack([np.cos(phase), np.sin(phase), np.ones(frames)], axis=-1)
