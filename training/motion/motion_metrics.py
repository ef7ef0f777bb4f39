"""What is measured on motions, generated beside real."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import sqrtm

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, joint_positions
from rfgen_sionna.generative.diffusion.rhythm import autocorrelation, principal_direction, relative_positions
from rfgen_sionna.generative.motion import Skeleton
from rfgen_sionna.generative.motion.limits import LIMITS, joint_angles
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion


def frechet(a: FloatArray, b: FloatArray) -> float:
    """Fréchet distance of two sets of (n, k) features, each taken as a normal distribution."""
    mean = np.sum((a.mean(axis=0) - b.mean(axis=0)) ** 2)
    ca, cb = (np.cov(x, rowvar=False) for x in (a, b))
    root = np.real(sqrtm(ca @ cb))
    return float(mean + np.trace(ca + cb - 2.0 * root))


def frechet_floor(a: FloatArray, count: int, rng: np.random.Generator, times: int = 5) -> float:
    """Mean Fréchet distance between two disjoint draws of `count` from one set."""
    count = min(count, len(a) // 2)
    out = []
    for _ in range(times):
        order = rng.permutation(len(a))
        out.append(frechet(a[order[:count]], a[order[count : 2 * count]]))
    return float(np.mean(out))


def mean_jerk(features: FloatArray) -> float:
    """Mean over joints and time of the third derivative of the joint positions [m/s^3], at 20 Hz."""
    return float(np.linalg.norm(np.diff(joint_positions(features), n=3, axis=0), axis=-1).mean() * FRAME_RATE**3)


def foot_slide(motion: Motion, skeleton: Skeleton, height: float = 0.005) -> float:
    """Mean horizontal speed [m/s] of the stiller of toe joint and heel, of feet that touch the floor; nan if none does.

    A foot touches the floor where its toe joint or heel is at most `height` [m] over it; the motion's own contacts
    aren't asked.
    """
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    total, count = 0.0, 0
    for i, side in enumerate(SIDES):
        ankle = places[:, JOINT[f"{side}_ankle"]]
        toe = places[:, JOINT[f"{side}_foot"]]
        heel = ankle + world[:, JOINT[f"{side}_ankle"]] @ skeleton.heel[i]
        speeds = []
        for point, rest in ((toe, skeleton.toe_height), (heel, 0.0)):
            down = (point[1:, 2] < rest + height) & (point[:-1, 2] < rest + height)
            speed = np.linalg.norm(np.diff(point[:, :2], axis=0), axis=-1) * motion.frame_rate
            speeds.append(np.where(down, speed, np.inf))
        stiller = np.min(speeds, axis=0)
        total += float(stiller[np.isfinite(stiller)].sum())
        count += int(np.isfinite(stiller).sum())
    return total / count if count else float("nan")


def out_of_limits(motion: Motion, tolerance: float = 1.0) -> float:
    """Share of poses with a joint angle more than `tolerance` [degrees] out of its range; needs all 52 joints."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    bad = np.zeros(len(world), bool)
    for name, values in joint_angles(world).items():
        over = np.maximum(values - LIMITS[name].high, LIMITS[name].low - values)
        bad |= (over > tolerance).any(axis=-1)
    return float(bad.mean())


def variance(motions: Sequence[FloatArray]) -> float:
    """Variance between motions of one action, pose by pose, mean over joints and time [m^2]; the same in the mean for
    any number of them."""
    n = min(len(m) for m in motions)
    places = np.stack([relative_positions(m)[:n] for m in motions])
    return float(places.var(axis=0, ddof=1).mean())


def nearest(motions: Sequence[FloatArray], others: Sequence[FloatArray], length: int = 40) -> FloatArray:
    """(motion,) distance [m] of two seconds from the middle of each motion to the nearest stretch of the others: rms
    over joints and time; infinite where no other is long enough.

    Raises:
        ValueError: a motion is shorter than the stretch.
    """
    rows = []
    for motion in motions:
        if len(motion) < length:
            raise ValueError(f"motion: {len(motion)} poses; {length} are needed to compare")
        start = (len(motion) - length) // 2
        rows.append(relative_positions(motion)[start : start + length].astype(np.float32).ravel())
    asked = np.stack(rows)
    own = np.sum(asked**2, axis=1)
    least = np.full(len(asked), np.inf, np.float32)
    for other in others:
        # one clip at a time: all stretches of captured motion together are half a gigabyte
        places = relative_positions(other).astype(np.float32)
        stretches = [places[k : k + length].ravel() for k in range(0, len(places) - length + 1, 4)]
        if stretches:
            stack = np.stack(stretches)
            square = np.sum(stack**2, axis=1)[:, None] - 2.0 * (stack @ asked.T) + own
            least = np.minimum(least, square.min(axis=0))
    return np.sqrt(np.maximum(least, 0.0).astype(np.float64) / (asked.shape[1] / 3))


def rhythm_score(features: FloatArray, rate: float) -> float:
    """Height of the autocorrelation's highest peak for lags of 0.6 to 3 s, first principal component of the joints."""
    positions = relative_positions(features)
    positions = positions - positions.mean(axis=0)
    signal = positions @ principal_direction(positions)
    last = min(int(3.0 * rate) + 1, len(signal) - 4)
    r = autocorrelation(signal, last + 1)
    first = int(0.6 * rate)
    peaks = [r[k] for k in range(first, last) if r[k] >= r[k - 1] and r[k] >= r[k + 1]]
    return float(max(peaks, default=0.0))
