"""Interface of motion sources."""

from __future__ import annotations

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
