"""Definitions of actions and verdicts about motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals


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
