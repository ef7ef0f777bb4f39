"""Interpreted prompt: who, what, where and how, each value with its origin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.generative.action_catalogue import ACTION_CLAUSES
from rfgen_sionna.generative.decisions import DEFAULT, Decision, drawn, tabulate
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.prompts.body_prompt import BodyPrompt
from rfgen_sionna.generative.prompts.environment_prompt import NOWHERE

DEFAULT_DISTANCE = 3.0
"""Default distance from the radar [m]."""
CLIP = "clip: "
"""Beginning of the action of a person who moves as a clip does; its name follows."""
DECIDED = "decided:"
"""Heading of the decisions in a report."""
_FACING = {0.0: ", facing the radar", 90.0: ", turned left", 180.0: ", back to the radar", 270.0: ", turned right"}
_UNITS = {"gender": "", "age": " years", "height": " m", "weight": " kg", "muscle": " (0 to 1)"}


@dataclass(frozen=True, repr=False)
class ScenePrompt(ShortRepr):
    """Interpreted prompt; None leaves a choice to the simulation."""

    text: str
    negative: str
    seed: int
    action: str
    """Name of the action."""
    target: str = "person"
    choices: tuple[str, ...] = ()
    """Actions that both prompts allow; the seed draws `action` from them."""
    orientation_deg: float | None = None
    """Rotation of the person from facing the radar, towards the person's left [degrees, 0 to 360)."""
    distance_m: float | None = None
    """Distance from the radar over the floor [m]."""
    bearing_deg: float | None = None
    """Azimuth of the person from the boresight, positive to the radar's left [degrees, -90 to 90]."""
    body: BodyPrompt = field(default_factory=BodyPrompt)
    manner: Manner = field(default_factory=Manner)
    """How the action is done."""
    breathing_rate: float | None = None
    """Breaths a minute; 0 for a held breath."""
    heart_rate: float | None = None
    """Heartbeats a minute."""
    surroundings: str | None = None
    """Name of a scene, or "free space"."""
    understood: tuple[tuple[str, str], ...] = ()
    """(phrase, meaning)."""
    unused: tuple[str, ...] = ()
    """Phrases without effect."""
    origins: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Value -> origin (:mod:`rfgen_sionna.generative.decisions`)."""
    arms: str = ""
    """Action of the arms; empty for the same one."""
    notes: tuple[str, ...] = ()
    """Warnings."""

    @property
    def hand(self) -> str | None:
        """Hand of a gesture: "left", "right" or "both"."""
        return self.manner.hand

    @property
    def speed(self) -> float | None:
        """Factor on the action's usual speed."""
        return self.manner.speed

    @property
    def speed_mps(self) -> float | None:
        """Mean speed over the floor [m/s]."""
        return self.manner.speed_mps

    @property
    def warnings(self) -> tuple[str, ...]:
        """`notes`, and one sentence for each phrase without effect."""
        return (*self.notes, *(f"prompt: {phrase!r} was not understood and has no effect" for phrase in self.unused))

    def decisions(self) -> list[Decision]:
        """Decisions without a body: words, defaults and draws of the seed."""
        action = self.action if self.action.startswith(CLIP) else f"{self.action}: {ACTION_CLAUSES[self.action]}"
        angle, bearing = self.orientation_deg or 0.0, self.bearing_deg or 0.0
        rows = [("target", f"a {self.target}"), ("action", action)]
        if self.arms:
            rows.append(("arms", f"{self.arms}: {ACTION_CLAUSES[self.arms]}"))
        if self.hand is not None:
            rows.append(("hand", self.hand))
        for name, rate in (("breathing", self.breathing_rate), ("heart", self.heart_rate)):
            if rate is not None:
                rows.append((name, f"{rate:g} a minute"))
        rows += [
            ("orientation", f"{angle:g}°{_FACING.get(angle, '')}"),
            ("distance", f"{DEFAULT_DISTANCE if self.distance_m is None else self.distance_m:g} m"),
            ("azimuth", f"{bearing:g}°{'' if bearing else ', straight ahead'}"),
            ("speed", f"× {self.speed or 1.0:g}" if self.speed_mps is None else f"{self.speed_mps:g} m/s"),
            *self._manner_rows(),
            ("surroundings", self.surroundings or NOWHERE),
        ]
        found = [Decision(name, value, self.origins.get(name, DEFAULT)) for name, value in rows]
        for trait, value in self.body.traits().items():
            origin = self.origins.get(trait, drawn(self.seed))
            text = "open" if value is None else value if isinstance(value, str) else f"{value:g}{_UNITS[trait]}"
            found.append(Decision(trait, text, origin))
        return found

    def _manner_rows(self) -> list[tuple[str, str]]:
        """(decision, value) of a manner that words give, beside hand and speed."""
        manner = self.manner
        rows = [
            ("amplitude", manner.amplitude and f"× {manner.amplitude:g}"),
            ("rate", manner.rate and f"{manner.rate:g} a minute"),
            ("path", manner.path and manner.path.replace("_", " ")),
            ("pauses", manner.pauses and "with pauses"),
            ("arm posture", manner.arm_posture and manner.arm_posture.replace("_", " ")),
            ("tired", manner.tired and "yes"),
        ]
        return [(name, str(value)) for name, value in rows if value]

    def words(self) -> str:
        """Phrases and their meanings; several lines."""
        lines = [f"prompt: {self.text}"]
        if self.negative:
            lines.append(f"negative: {self.negative}")
        width = max((len(phrase) for phrase, _ in self.understood), default=0)
        lines += [f"  {phrase:<{width}}  {meaning}" for phrase, meaning in self.understood]
        return "\n".join(lines)

    def report(self, decisions: Sequence[Decision] | None = None) -> str:
        """Phrases, their meanings, and `decisions` with their origins; several lines. None takes :meth:`decisions`."""
        lines = [self.words(), *(f"  {note}" for note in self.notes)]
        lines += [f"  not understood, no effect: {phrase}" for phrase in self.unused]
        lines += [DECIDED, *tabulate(self.decisions() if decisions is None else decisions)]
        return "\n".join(lines)


def check_seed(seed: int) -> None:
    """Raise a ValueError unless `seed` is a whole number of at least 0."""
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed is {seed!r}: a whole number of at least 0 is needed")
