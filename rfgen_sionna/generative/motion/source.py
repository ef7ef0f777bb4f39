"""The one interface that every origin of motion has."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from rfgen_sionna.generative.motion.skeleton import Skeleton
from rfgen_sionna.records import Motion


@runtime_checkable
class MotionSource(Protocol):
    """Turns the name of an action into a motion: kinematic, learned, or whatever else."""

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
            duration: wanted length [s].
            seed: every random choice comes from it.
            skeleton: proportions of the person; None for a mean adult.
            hand: "left" or "right" for actions of one hand; None leaves it to the source.
            speed: factor on the usual speed of the action.
        """
        ...
