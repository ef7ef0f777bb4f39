"""Definitions of actions and verdicts about motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.action_definitions.sampled_series import share


@dataclass(frozen=True)
class Requirement:
    """A measured value and the range in which it must be."""

    quantity: str
    """With its unit: "height of the pelvis at the end [m]"."""
    value: float
    least: float = float("-inf")
    most: float = float("inf")

    @property
    def holds(self) -> bool:
        return self.least <= self.value <= self.most

    def __str__(self) -> str:
        """Value and range in words."""
        bounds = [
            f"{word} {bound:g}"
            for word, bound in (("at least", self.least), ("at most", self.most))
            if abs(bound) != float("inf")
        ]
        return f"{self.quantity}: {self.value:.3g}, {' and '.join(bounds)} is needed"


Requirements = list[Requirement]
Predicate = Callable[[MotionSignals], Requirements]


def at_least(quantity: str, value: float, bound: float) -> Requirement:
    """`value` must be `bound` or more."""
    return Requirement(quantity, float(value), least=bound)


def at_most(quantity: str, value: float, bound: float) -> Requirement:
    """`value` must be `bound` or less."""
    return Requirement(quantity, float(value), most=bound)


def easiest(alternatives: Sequence[Requirements]) -> Requirements:
    """The alternative that holds, or the one with the fewest requirements that fail."""
    return min(alternatives, key=lambda each: sum(not one.holds for one in each))


def in_place(signals: MotionSignals, most: float = 0.4) -> Requirements:
    """On the feet, within `most` [m] of one place."""
    return [
        at_least("share of time on the feet", share(signals.legs > 0.85), 0.9),
        at_most("distance of the pelvis from its median place [m]", signals.roam, most),
    ]


def either_side(of: Callable[[int], Requirements]) -> Requirements:
    """The easier one of the requirements of the left (0) and of the right (1) side."""
    return easiest([of(0), of(1)])


@dataclass(frozen=True)
class Definition:
    """What must be true of a motion that shows an action."""

    action: str
    sentence: str
    """What must be true, for people."""
    requirements: Predicate
    undecided: str = ""
    """What the joints of a body cannot decide, or empty."""

    def __call__(self, signals: MotionSignals) -> Requirements:
        """Its requirements, measured on a motion."""
        return self.requirements(signals)


def defines(action: str, sentence: str, undecided: str = "") -> Callable[[Predicate], Definition]:
    """Decorator that makes requirements the definition of an action."""
    return lambda requirements: Definition(action, sentence, requirements, undecided)


@dataclass(frozen=True)
class Verdict:
    """Whether a motion shows an action."""

    action: str
    true: bool
    reasons: tuple[str, ...]
    """Each requirement that fails, with the measured value; empty for a true one."""

    def __bool__(self) -> bool:
        return self.true
