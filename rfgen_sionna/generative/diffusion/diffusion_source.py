"""Motion source that performs actions and varies them by the motion model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES
from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, is_true_of
from rfgen_sionna.generative.diffusion.variation import SHORTEST, STRENGTH, loaded, vary
from rfgen_sionna.generative.diffusion.variation_model import SHIPPED, VariationModel
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import Skeleton
from rfgen_sionna.generative.performing import PerformingSource
from rfgen_sionna.records import Motion

_LEAST = 0.05
"""Strength under which a variation is given up."""


@dataclass(frozen=True)
class DiffusionSource:
    """Actions by :func:`~rfgen_sionna.generative.performing.perform`, then varied by the motion model.

    Raises:
        ValueError: the strength is not from 0 to 1.
        FileNotFoundError: there is no such file of weights.
    """

    strength: float = STRENGTH
    """Of the variation, 0 (none) to 1; see :func:`~rfgen_sionna.generative.diffusion.variation.vary`."""
    weights: Path | None = None
    """Model file; None takes the shipped one."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.strength <= 1.0:
            raise ValueError(f"strength: {self.strength!r}; allowed are 0, no variation, to 1")
        if self.weights is not None and not Path(self.weights).is_file():
            raise FileNotFoundError(f"weights: no model file {self.weights}; None takes the one that ships")

    @property
    def model(self) -> VariationModel:
        """The trained model, loaded once."""
        return loaded(Path(self.weights or SHIPPED))

    def __call__(
        self,
        action: str,
        duration: float,
        seed: int,
        *,
        skeleton: Skeleton | None = None,
        hand: str | None = None,
        speed: float = 1.0,
        manner: Manner | None = None,
        arms: str = "",
    ) -> Motion:
        """A motion that shows an action; arguments and errors as for
        :class:`~rfgen_sionna.generative.performing.PerformingSource`."""
        perform = PerformingSource()
        return self.vary(
            perform(action, duration, seed, skeleton=skeleton, hand=hand, speed=speed, manner=manner, arms=arms)
        )

    def vary(self, draft: Motion, text: str = "", *, seed: int | None = None) -> Motion:
        """A variation that shows what its draft shows.

        The strength is halved until the variation agrees with the definition of the draft's action, if the draft does;
        a draft that allows no variation, or is shorter than one, is returned.

        Args:
            draft: a motion with SMPL's body joints.
            text: what the person does; empty takes the clause of the draft's action.
            seed: of the variation; None takes the draft's, or 0.
        """
        seed = seed if seed is not None else draft.seed or 0
        text = text or (f"a person {ACTION_CLAUSES[draft.action]}" if draft.action in ACTION_CLAUSES else "")
        shows = draft.action in DEFINED_ACTIONS and is_true_of(draft, draft.action)
        strength = self.strength if draft.duration >= SHORTEST else 0.0
        while strength >= _LEAST:
            varied = vary(draft, text, strength=strength, seed=seed, weights=self.weights)
            if not shows or is_true_of(varied, draft.action):
                return replace(varied, prompt=draft.prompt)
            strength /= 2.0
        return draft
