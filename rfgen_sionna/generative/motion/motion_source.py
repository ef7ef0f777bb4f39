"""Interface of motion sources."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from rfgen_sionna.generative.motion.skeleton import Skeleton
from rfgen_sionna.records import Motion


@runtime_checkable
class MotionSource(Protocol):
    """Source of motion by action name, kinematic or learned."""

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
        """A motion of at least `duration` [s].

        Args:
            action: name of the action.
            duration: requested length [s].
            seed: of all random choices.
            skeleton: proportions of the person; None takes a mean adult.
            hand: "left", "right" or "both" for gestures (swipes take one hand); None lets the source choose.
            speed: factor on the usual speed of the action.
        """


class PromptReading(Protocol):
    """Reading of a sentence by a motion source."""

    @property
    def action(self) -> str:
        """Likeliest action."""

    @property
    def share(self) -> float:
        """Its probability."""

    @property
    def arms(self) -> str:
        """Action of the arms at the same time, or empty."""

    @property
    def known(self) -> bool:
        """Whether the sentence is within the training vocabulary."""

    @property
    def unknown(self) -> tuple[str, ...]:
        """Words outside the training vocabulary."""

    @property
    def ranking(self) -> tuple[str, ...]:
        """All actions, likeliest first."""


@runtime_checkable
class SentenceSource(MotionSource, Protocol):
    """Motion source that reads sentences."""

    @property
    def arms(self) -> Sequence[str]:
        """Arm actions that combine with those of :attr:`legs`."""

    @property
    def legs(self) -> Sequence[str]:
        """Actions that leave the arms free."""

    def read(self, prompt: str) -> PromptReading:
        """Reading of a sentence."""

    def generate(
        self,
        prompt: str,
        *,
        duration: float,
        seed: int,
        negative: str,
        skeleton: Skeleton | None,
        speed: float,
        action: str | None,
        arms: str,
    ) -> Motion:
        """A motion from a sentence that was read as `action`, with `arms` as action of the arms; the rest as in a
        call."""
