"""Joint paths of animals that ship with the package.

`clips/animals.npz` holds keyframed clips of Mesh2Motion (CC0); `clips/README.md` is its card. Gaits are one cycle
without their forward motion.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.driving import ramp_integral

FOLDER = Path(__file__).with_name("clips")
"""Folder of the shipped file."""
_STEP = 0.1e-3
"""Step of stored positions [m]."""
_EASE = 0.15
"""Time in which a clip starts and stops [s]: poses are held before and after."""


@dataclass(frozen=True, eq=False)
class AnimalClip:
    """Joint positions of an animal that performs an action, z up, facing +x, on the floor z = 0."""

    animal: str
    action: str
    joint_names: tuple[str, ...]
    positions: FloatArray
    """(frame, joint, 3) [m]."""
    length: float
    """Time of the frames [s]: of the cycle, or from the first to the last one."""
    cyclic: bool
    forward_speed: float
    """Speed at which planted feet are at rest [m/s]; 0 for actions in place."""

    @property
    def stride(self) -> float:
        """Forward motion in a cycle [m]."""
        return self.forward_speed * self.length

    @cached_property
    def _curve(self) -> CubicSpline:
        values = np.concatenate([self.positions, self.positions[:1]]) if self.cyclic else self.positions
        times = np.linspace(0.0, self.length, len(values))
        return CubicSpline(times, values, bc_type="periodic" if self.cyclic else "natural")

    def joints(self, time: float) -> FloatArray:
        """(joint, 3) positions [m] at a time of the clip [s]: C², also where a clip begins and ends at rest."""
        if self.cyclic:
            return np.asarray(self._curve(time % self.length))
        return np.asarray(self._curve(_eased(time, self.length)))


def _eased(time: float, length: float) -> float:
    """Time within a clip, from standstill to standstill: C², with the clip's pace in between."""
    ramp = min(_EASE, 0.5 * length)
    return ramp * (ramp_integral(time / ramp) - ramp_integral((time - length) / ramp))


@lru_cache(maxsize=1)
def animal_clips(path: Path = FOLDER / "animals.npz") -> Mapping[tuple[str, str], AnimalClip]:
    """Clips of a file by animal and action."""
    with np.load(path, allow_pickle=False) as stored:
        records = json.loads(stored["clips"].tobytes())
        names: dict[str, list[str]] = json.loads(stored["joint_names"].tobytes())
        steps = stored["positions"]
    found, first = {}, 0
    for record in records:
        joints = tuple(names[record["animal"]])
        last = first + record.pop("frames") * len(joints) * 3
        positions = np.cumsum(steps[first:last].reshape(-1, len(joints), 3), axis=0, dtype=np.int16)
        clip = AnimalClip(joint_names=joints, positions=_STEP * positions.astype(np.float64), **record)
        found[clip.animal, clip.action] = clip
        first = last
    return found


def write_animal_clips(path: Path, clips: Sequence[AnimalClip]) -> None:
    """Write clips as :func:`animal_clips` reads them, in steps of 0.1 mm."""
    records, steps = [], []
    for clip in clips:
        record = {key: value for key, value in asdict(clip).items() if key not in ("joint_names", "positions")}
        records.append(record | {"frames": len(clip.positions)})
        whole = np.rint(clip.positions / _STEP).astype(np.int16)
        steps.append(np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1])).ravel())
    names = {clip.animal: clip.joint_names for clip in clips}
    np.savez_compressed(
        path,
        positions=np.concatenate(steps),
        joint_names=np.frombuffer(json.dumps(names).encode(), np.uint8),
        clips=np.frombuffer(json.dumps(records).encode(), np.uint8),
    )


JointPath = Callable[[float], FloatArray]
"""(joint, 3) positions [m] at a time [s]."""
