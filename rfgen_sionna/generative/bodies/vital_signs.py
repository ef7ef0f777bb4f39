"""Breathing and heartbeat: chest and belly move outwards and back on the skin of a body in any pose.

Typical displacements of the skin of resting adults are 4 to 12 mm by breathing and 0.2 to 0.5 mm by the heart (A. D.
Droitcour et al., IEEE Trans. MTT-52 (2004), 838; G. Ramachandran and M. Singh, Med. Biol. Eng. Comput. 27 (1989), 525).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.motion.skeleton import JOINT

_LIMITS = {
    "breathing_rate": (0.0, 90.0), "heart_rate": (0.0, 240.0), "belly_depth": (0.0, 0.04), "chest_depth": (0.0, 0.03),
    "heart_depth": (0.0, 0.003), "variability": (0.0, 0.3), "seed": (0, np.inf),
}  # fmt: skip
"""Least and largest values; depths in other units than metres fall outside."""
_MODULATIONS = (3.7, 6.1, 10.3, 17.9)
"""Periods of the changes of a rate, in its own periods: their ratios are no simple ones, so that cycles differ."""
_INSPIRATION = 0.2
"""Skewness of the breath: the share of inspiration is 0.5 - 0.2 / pi of a cycle, 44 %."""
_PULSE = 4.0
"""Concentration of a heartbeat in its period: it lasts a third of it."""
_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar")


@dataclass(frozen=True, repr=False)
class VitalSigns(ShortRepr):
    """Rates and displacements of breathing and heart; rates and depths vary from cycle to cycle.

    Raises
    ------
    ValueError
        A field is out of range.
    """

    breathing_rate: float = 15.0
    """Mean rate [1/min]; 0 holds the breath."""
    heart_rate: float = 70.0
    """Mean rate [1/min]; 0 for none."""
    belly_depth: float = 6e-3
    """Displacement of the belly from exhaling to inhaling [m]."""
    chest_depth: float = 4e-3
    """Displacement of the middle of the chest from exhaling to inhaling [m]."""
    heart_depth: float = 4e-4
    """Displacement of the skin over the heart by a beat [m]."""
    variability: float = 0.03
    """Standard deviation of a cycle's length, relative to its mean."""
    seed: int = 0
    """Seed of phases and variations."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, (low, high) = getattr(self, field.name), _LIMITS[field.name]
            if isinstance(value, bool) or not np.isreal(value) or not low <= value <= high:
                raise ValueError(f"vital_signs.{field.name} is {value!r}: {low:g} … {high:g} is allowed")

    def volume(self, t: float) -> float:
        """Inflation at `t` [s]: 0 after exhaling, 1 after inhaling."""
        if not self.breathing_rate:
            return 0.5
        phase = self._breath.phase(t)
        return float(0.5 - 0.5 * np.cos(phase + _INSPIRATION * np.sin(phase)))

    def pulse(self, t: float) -> float:
        """Heartbeat at `t` [s], 0 to 1."""
        if not self.heart_rate:
            return 0.0
        return float(np.exp(_PULSE * (np.cos(self._heart.phase(t)) - 1.0)))

    def chest_displacement(self, t: float) -> float:
        """Displacement of the chest over the heart at `t` [s], outwards [m]."""
        return self.chest_depth * self.volume(t) + self.heart_depth * self.pulse(t)

    @cached_property
    def _breath(self) -> _Cycle:
        return _Cycle(self.breathing_rate / 60.0, self.variability, [self.seed, 71])

    @cached_property
    def _heart(self) -> _Cycle:
        return _Cycle(self.heart_rate / 60.0, self.variability, [self.seed, 72])


class _Cycle:
    """Phase of a rate [Hz] that varies by incommensurate sines, smooth for all times."""

    def __init__(self, rate: float, variability: float, seed: list[int]) -> None:
        rng = np.random.default_rng(seed)
        self._rate, self._start = rate, rng.uniform(0.0, 2 * np.pi)
        self._modulation = rate / np.array(_MODULATIONS)
        self._shift = rng.uniform(0.0, 2 * np.pi, len(_MODULATIONS))
        # n sines of equal amplitude a have the variance n a^2 / 2; the rate changes by a times the modulation's phase
        amplitude = variability * np.sqrt(2.0 / len(_MODULATIONS))
        self._swing = amplitude * rate / self._modulation

    def phase(self, t: float) -> float:
        """Phase at `t` [s], in radians."""
        swing = np.sum(self._swing * np.sin(2 * np.pi * self._modulation * t + self._shift))
        return float(self._start + 2 * np.pi * self._rate * t + swing)


def skin_directions(rig: Rig, signs: VitalSigns) -> tuple[FloatArray, FloatArray]:
    """(vertex, 3) displacements of the rest pose [m] by a full breath, and by a heartbeat.

    Belly and chest move along the skin's normals, most at the navel and at the middle of the breastbone, the heart's
    place to the left of it; back and limbs stay.
    """
    normals = _vertex_normals(rig)
    trunk = np.isin(rig.bone_joints, [JOINT[name] for name in _TRUNK]).astype(np.float64)
    # Smooth from the sides to the front, and where limbs begin.
    front = np.clip(normals[:, 0], 0.0, 1.0)
    share = (rig.weights @ trunk) ** 2 * front**2 * (3.0 - 2.0 * front)
    low, middle, high, neck = (rig.heads[rig.joint_bones[JOINT[n]]] for n in ("spine1", "spine2", "spine3", "neck"))
    size = neck[2] - low[2]

    def bump(height: float, side: float, width: float) -> FloatArray:
        offset = (rig.vertices[:, 2] - height) ** 2 + (rig.vertices[:, 1] - side) ** 2
        return np.asarray(share * np.exp(-offset / (width * size) ** 2))

    belly = bump(0.3 * low[2] + 0.7 * middle[2], 0.0, 0.25)
    chest = bump(0.5 * (high[2] + neck[2]), 0.0, 0.24)
    heart = bump(0.6 * high[2] + 0.4 * neck[2], 0.07 * size, 0.25)
    breath = signs.belly_depth * belly / belly.max() + signs.chest_depth * chest / chest.max()
    return breath[:, None] * normals, (signs.heart_depth * heart / heart.max())[:, None] * normals


def _vertex_normals(rig: Rig) -> FloatArray:
    corners = rig.vertices[rig.faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(rig.vertices)
    for corner in range(3):
        np.add.at(normals, rig.faces[:, corner], area)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
