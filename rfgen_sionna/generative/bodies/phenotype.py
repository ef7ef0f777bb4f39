"""Attributes of a person in natural units, and anny's parameters for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from rfgen_sionna.generative.bodies.anny_rig import build_rig, rest_shape, stature_and_mass
from rfgen_sionna.generative.bodies.rig import Rig

# Years over anny's age parameter, and the Beta distribution of its height parameter for boys: anny's calibration to the
# WHO's growth charts (data/shape_calibration/boys.pth).
_YEARS = (0.0, 1.0, 4.0, 11.0, 16.0, 18.0, 64.0, 110.0)
_AGE_PARAMETER = (0.0, 0.05, 0.215, 0.415, 0.67, 0.77, 0.83, 1.0)
_GROWTH_AGES = (0.0, 0.05, 0.215, 0.415, 0.67)
_GROWTH_ALPHA = (21.596, 51.978, 22.147, 13.405, 16.496)
_GROWTH_BETA = (58.601, 57.36, 45.859, 22.105, 25.656)

_STATURE = ((1.756, 0.069), (1.628, 0.064))
"""Stature of men and women, mean and standard deviation [m]: ANSUR II (2012)."""
_MASS_INDEX = (24.5, 3.0, 19.0, 31.0)
"""Body mass index of adults, mean, deviation, bounds [kg/m^2]: most of the WHO's normal and overweight bands."""

HEAVIEST = 1.25
"""Upper bound of anny's weight parameter for soft bodies, by its linear extrapolation beyond 1."""
THINNEST_MUSCLE = 0.15
"""Lower bound of the muscle parameter of a thin person with a low weight."""
_HEIGHT_TOLERANCE = 1e-3
"""Upper bound of the error of a fitted stature [m]: a millimetre."""
_ROUNDS = 10
"""Upper bound of the rounds of fitting height and weight in turn; two or three suffice."""

LIMITS = {"age": (2.0, 100.0), "height": (0.8, 2.3), "weight": (8.0, 250.0), "muscle": (0.0, 1.0)}
GENDERS = {"male": 0.0, "female": 1.0}


class PhenotypeError(ValueError):
    """An attribute out of range or out of anny's reach."""


@dataclass(frozen=True)
class Phenotype:
    """Attributes of a person; the seed draws those that are None. PhenotypeError for values out of range."""

    gender: str | float | None = None
    """"male", "female", or a number from 0 (male) to 1 (female)."""
    age: float | None = None
    """[years]; drawn from 18 to 75."""
    height: float | None = None
    """Stature [m]; drawn from the distribution of the gender for adults, of the age for minors."""
    weight: float | None = None
    """Body mass [kg]; drawn for adults from a distribution of the body mass index."""
    muscle: float | None = None
    """0 (weak) to 1 (very muscular)."""

    def __post_init__(self) -> None:
        if isinstance(self.gender, str):
            if self.gender not in GENDERS:
                raise PhenotypeError(f"gender: {self.gender!r}; allowed are male, female or a number from 0 to 1")
        elif self.gender is not None and not 0.0 <= self.gender <= 1.0:
            raise PhenotypeError(f"gender: {self.gender!r}; allowed are male, female or a number from 0 to 1")
        for name, (low, high) in LIMITS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise PhenotypeError(f"{name}: {value!r}; allowed is {low:g} to {high:g}")

    def complete(self, seed: int) -> dict[str, float]:
        """anny's parameters (each 0 .. 1); attributes that are None are drawn from `seed`, each from its own stream.

        Raises:
            PhenotypeError: height or weight out of anny's reach for the other attributes.
        """
        gender_rng, age_rng, height_rng, weight_rng, muscle_rng, shape_rng = (
            np.random.default_rng([seed, 13, i]) for i in range(6)
        )
        drawn_gender = float(gender_rng.integers(2))
        gender = drawn_gender if self.gender is None else GENDERS.get(self.gender, self.gender)  # type: ignore[arg-type]
        age = float(age_rng.uniform(18.0, 75.0)) if self.age is None else float(self.age)
        muscle = float(muscle_rng.uniform(0.35, 0.7)) if self.muscle is None else float(self.muscle)
        parameters = {
            "gender": float(gender), "age": float(np.interp(age, _YEARS, _AGE_PARAMETER)), "muscle": muscle,
            "weight": float(weight_rng.uniform(0.2, 0.8)), "height": 0.4,
            "proportions": float(shape_rng.uniform(0.3, 0.7)),
        }  # fmt: skip
        height = self.height
        if height is None:
            z, share = np.clip(height_rng.standard_normal(), -2.2, 2.2), height_rng.uniform()
            if age >= 18.0:
                mean, spread = (float(np.interp(gender, (0.0, 1.0), column)) for column in zip(*_STATURE, strict=True))
                height = mean + spread * z
            else:
                parameters["height"] = _growth(parameters["age"], share)
        weight, insist = self.weight, True
        if weight is None and age >= 18.0 and height is not None:
            mean, spread, low, high = _MASS_INDEX
            index = float(np.clip(mean + spread * weight_rng.standard_normal(), low, high))
            weight, insist = index * height**2, False
        # height depends a little on weight and muscle: solved in turns
        for _ in range(1 if weight is None else _ROUNDS):
            if height is not None:
                parameters["height"] = _solve(parameters, "height", height, lambda p: _measure(p)[0], "m")
            if weight is None:
                break
            self._fit_weight(parameters, weight, insist)
            if height is None or abs(_measure(parameters)[0] - height) < _HEIGHT_TOLERANCE:
                break
        return parameters

    def _fit_weight(self, parameters: dict[str, float], goal: float, insist: bool) -> None:
        """Fit the weight parameter, and a muscle parameter that is None, to the mass `goal` [kg].

        `insist` raises an error for a mass out of reach; otherwise the nearest one is taken.
        """
        least, most = (_measure({**parameters, "weight": w})[1] for w in (0.0, 1.0))
        if self.muscle is None and goal > most:
            # at full weight less muscle makes the heavier body
            soft = {**parameters, "weight": 1.0}
            utmost = _measure({**soft, "muscle": 0.0})[1]
            if goal <= utmost:
                muscle = brentq(lambda m: _measure({**soft, "muscle": m})[1] - goal, 0.0, soft["muscle"], xtol=1e-4)
                parameters.update(weight=1.0, muscle=float(muscle))
                return
            parameters["muscle"] = 0.0
            heaviest = _measure({**parameters, "weight": HEAVIEST})[1]
            if goal > heaviest and insist:
                raise PhenotypeError(_out_of_reach("weight", goal, least, heaviest, "kg"))
            goal = min(goal, heaviest)
        elif self.muscle is None and goal < least:
            thin = {**parameters, "weight": 0.0}
            utmost = _measure({**thin, "muscle": THINNEST_MUSCLE})[1]
            if goal < utmost and insist:
                raise PhenotypeError(_out_of_reach("weight", goal, utmost, most, "kg"))
            goal = max(goal, utmost)
            muscle = THINNEST_MUSCLE
            if goal > utmost:
                muscle = brentq(
                    lambda m: _measure({**thin, "muscle": m})[1] - goal, THINNEST_MUSCLE, thin["muscle"], xtol=1e-4
                )
            parameters.update(weight=0.0, muscle=float(muscle))
            return
        elif not insist:
            goal = min(max(goal, least), most)
        top = HEAVIEST if parameters["muscle"] == 0.0 else 1.0
        parameters["weight"] = _solve(parameters, "weight", goal, lambda p: _measure(p)[1], "kg", top)


def _growth(age_parameter: float, share: float) -> float:
    from scipy.stats import beta

    a = np.interp(age_parameter, _GROWTH_AGES, _GROWTH_ALPHA)
    b = np.interp(age_parameter, _GROWTH_AGES, _GROWTH_BETA)
    return float(beta.ppf(share, a, b))


def _measure(parameters: dict[str, float]) -> tuple[float, float]:
    return stature_and_mass(rest_shape(parameters)[0])


def _out_of_reach(name: str, goal: float, low: float, high: float, unit: str) -> str:
    return (
        f"{name}: {goal:g} {unit} is out of reach for this body; allowed is {low:.2f} to {high:.2f} {unit} "
        "(another gender, age, height or muscle shifts it)"
    )


def _solve(
    parameters: dict[str, float],
    name: str,
    goal: float,
    measure: Callable[[dict[str, float]], float],
    unit: str,
    top: float = 1.0,
) -> float:
    """Value of a parameter in [0, `top`] at which the increasing `measure` is `goal`."""
    low, high = (measure({**parameters, name: v}) for v in (0.0, top))
    if not low <= goal <= high:
        raise PhenotypeError(_out_of_reach(name, goal, low, high, unit))
    return float(brentq(lambda v: measure({**parameters, name: v}) - goal, 0.0, top, xtol=1e-4))


def describe(rig: Rig) -> Phenotype:
    """Attributes of a body: all for one by :func:`person`, height and weight for others."""
    if rig.parameters is None:
        return Phenotype(height=rig.height, weight=rig.mass)
    p = rig.parameters
    return Phenotype(
        gender=p["gender"],
        age=float(np.interp(p["age"], _AGE_PARAMETER, _YEARS)),
        height=rig.height,
        weight=rig.mass,
        muscle=p["muscle"],
    )


def person(phenotype: Phenotype | None = None, *, seed: int = 0) -> Rig:
    """Rigged body of a person.

    Args:
        phenotype: attributes of the person; None draws all of them.
        seed: seed of the draws.

    Raises:
        PhenotypeError: an attribute out of range or out of anny's reach.
        ImportError: anny (or torch) is not installed.
    """
    return build_rig((phenotype or Phenotype()).complete(seed))
