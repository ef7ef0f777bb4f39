"""Diffuse scattering patterns of rough surfaces, as of `sionna.rt.scattering_pattern_registry`, in NumPy.

Source: V. Degli-Esposti et al., "Measurement and modelling of scattering from buildings", IEEE Trans. Antennas Propag.
55 (2007) 143.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from scipy.special import binom

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.scene_errors import MaterialError

Kind = Literal["lambertian", "directive", "backscattering"]


@dataclass(frozen=True)
class ScatteringPattern:
    """Share of the diffuse energy per solid angle [1/sr]; its integral over the hemisphere is 1.

    Raises:
        MaterialError: a field is out of range.
    """

    kind: Kind = "lambertian"
    alpha_r: int = 1
    """Exponent of the specular lobe, 1 … 200 ("directive", "backscattering")."""
    alpha_i: int = 1
    """Exponent of the lobe towards the source, 1 … 200 ("backscattering")."""
    lambda_: float = 1.0
    """Share of the energy in the specular lobe, 0 … 1 ("backscattering")."""

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in get_args(Kind):
            raise MaterialError(f"kind: {self.kind!r} given, allowed are {', '.join(map(repr, get_args(Kind)))}")
        for name in ("alpha_r", "alpha_i"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= 200:
                raise MaterialError(f"{name}: {value!r} given, a whole number of 1 … 200 is needed")
        if not (is_number(self.lambda_) and 0.0 <= self.lambda_ <= 1.0):
            raise MaterialError(f"lambda_: {self.lambda_!r} given, allowed are 0 … 1")

    def __call__(self, k_in: FloatArray, k_out: FloatArray, normal: FloatArray) -> FloatArray:
        """(...) share [1/sr] for unit vectors (..., 3): incident and scattered direction, normal on that side."""

        def dot(a: FloatArray, b: FloatArray) -> FloatArray:
            return np.asarray((a * b).sum(axis=-1))

        cos_in, cos_out = -dot(k_in, normal), dot(k_out, normal)
        if self.kind == "lambertian":
            return np.maximum(cos_out, 0.0) / np.pi
        specular = k_in + 2.0 * cos_in[..., None] * normal
        share = self.lambda_ if self.kind == "backscattering" else 1.0
        forth = (0.5 * (1.0 + dot(specular, k_out))) ** self.alpha_r
        back = (0.5 * (1.0 - dot(k_in, k_out))) ** self.alpha_i
        total = share * _lobe_energy(self.alpha_r, cos_in) + (1.0 - share) * _lobe_energy(self.alpha_i, cos_in)
        return np.where(cos_out > 0.0, (share * forth + (1.0 - share) * back) / total, 0.0)

    @property
    def of_sionna(self) -> dict[str, Any]:
        """Arguments of a `sionna.rt.RadioMaterial` with the same pattern."""
        lobes: dict[str, dict[str, Any]] = {
            "lambertian": {},
            "directive": {"alpha_r": self.alpha_r},
            "backscattering": {"alpha_r": self.alpha_r, "alpha_i": self.alpha_i, "lambda_": self.lambda_},
        }
        return {"scattering_pattern": self.kind, **lobes[self.kind]}

    @classmethod
    def from_sionna(cls, pattern: Any) -> ScatteringPattern:
        """The equivalent of a Sionna pattern.

        Raises:
            MaterialError: `pattern` is none of Sionna's own.
        """
        from sionna.rt.radio_materials.scattering_pattern import (
            BackscatteringPattern,
            DirectivePattern,
            LambertianPattern,
        )

        if isinstance(pattern, LambertianPattern):
            return cls()
        if isinstance(pattern, DirectivePattern):  # a subclass of BackscatteringPattern
            return cls("directive", alpha_r=int(pattern.alpha_r))
        if isinstance(pattern, BackscatteringPattern):
            share = pattern.lambda_
            share = float(share[0] if hasattr(share, "__getitem__") else share)
            return cls("backscattering", int(pattern.alpha_r), int(pattern.alpha_i), share)
        allowed = ", ".join(get_args(Kind))
        raise MaterialError(f"scattering pattern: {type(pattern).__name__} given, allowed are {allowed}")


LAMBERTIAN = ScatteringPattern()


def _lobe_energy(alpha: int, cos_in: FloatArray) -> FloatArray:
    """Integral over the hemisphere of ((1 + cos psi) / 2)^alpha; psi is the angle to a direction at arccos(`cos_in`)
    from the normal."""
    sin2 = np.maximum(1.0 - cos_in**2, 0.0)
    total, k = np.zeros_like(cos_in), np.zeros_like(cos_in)
    for j in range(alpha + 1):
        if j % 2 == 0:
            part = np.full_like(cos_in, 2.0 * np.pi / (j + 1))
        else:
            n = (j - 1) // 2
            k = k + binom(2 * n, n) * (sin2 / 4.0) ** n
            part = 2.0 * np.pi / (j + 1) * cos_in * k
        total += binom(alpha, j) * part
    return np.asarray(total / 2.0**alpha)
