"""The one interface that every origin of motion has."""

from __future__ import annotations

from collections.abc import Sequence
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
            hand: "left", "right" or "both" for gestures (swipes take one hand); None leaves it to the source.
            speed: factor on the usual speed of the action.
        """
        ...


class PromptReading(Protocol):
    """What a motion source makes of a sentence."""

    @property
    def action(self) -> str:
        """The likeliest action."""
        ...

    @property
    def share(self) -> float:
        """Its probability."""
        ...

    @property
    def arms(self) -> str:
        """What the arms do beside, or empty."""
        ...

    @property
    def known(self) -> bool:
        """Whether the source has learned such sentences."""
        ...

    @property
    def unknown(self) -> tuple[str, ...]:
        """Words that it has never seen."""
        ...

    @property
    def ranking(self) -> tuple[str, ...]:
        """All actions, likeliest first."""
        ...


@runtime_checkable
class SentenceSource(MotionSource, Protocol):
    """A motion source that reads sentences itself."""

    @property
    def arms(self) -> Sequence[str]:
        """The actions that arms can do beside those of :attr:`legs`."""
        ...

    @property
    def legs(self) -> Sequence[str]:
        """The actions that leave the arms free."""
        ...

    def read(self, prompt: str) -> PromptReading:
        """What it makes of a sentence."""
        ...

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
        """A motion from a sentence that was read as `action` and, for what arms do beside, `arms`; else as a call."""
        ...
