"""What a prompt asks for, in numbers and names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rfgen_sionna.generative.body_prompt import BodyPrompt
from rfgen_sionna.generative.decisions import DEFAULT, Decision, drawn, tabulate
from rfgen_sionna.generative.environment_prompt import NOWHERE
from rfgen_sionna.generative.motion.actions import ACTIONS

DEFAULT_DISTANCE = 3.0
"""Distance from the radar where neither prompt nor caller says one [m]."""
DECIDED = "decided:"
"""Heading of the decisions in a report."""
_FACING = {0.0: ", facing the radar", 90.0: ", turned left", 180.0: ", back to the radar", 270.0: ", turned right"}
_UNITS = {"gender": "", "age": " years", "height": " m", "weight": " kg", "muscle": " (0 to 1)"}


@dataclass(frozen=True)
class SourceReading:
    """What a motion source makes of a prompt in which the grammar finds no one action."""

    action: str
    origin: str
    """Who decided on it."""
    arms: str = ""
    arms_origin: str = ""
    sentence: str = ""
    """What the source is to read itself; empty where the action's name says all."""
    avoid: str = ""
    """The same of the negative prompt."""
    read: frozenset[str] = frozenset()
    """The phrases that the source has read and the grammar has not."""
    notes: tuple[str, ...] = ()
    """What is done instead of what was asked for."""


@dataclass(frozen=True)
class ScenePrompt:
    """What a prompt asks for. None stands where it leaves the choice to the simulation."""

    text: str
    negative: str
    seed: int
    action: str
    """Key of the registry of actions, or what a source that reads sentences calls a captured one."""
    target: str = "person"
    choices: tuple[str, ...] = ()
    """The actions that both prompts leave open; `action` is one of them, drawn from the seed."""
    orientation_deg: float | None = None
    """Angle by which the person is turned from facing the radar, counter-clockwise seen from above, so
    towards the person's own left [degrees, 0 to 360)."""
    distance_m: float | None = None
    """Distance from the radar over the floor [m]."""
    bearing_deg: float | None = None
    """Angle to the radar's boresight at which the person is, seen from above, positive to the radar's left
    [degrees, -90 to 90]."""
    body: BodyPrompt = field(default_factory=BodyPrompt)
    hand: str | None = None
    """"left", "right" or "both": the hand of a gesture; the seed draws it where no words say it."""
    speed: float | None = None
    """Factor on the action's usual speed."""
    surroundings: str | None = None
    """Name of a scene, or "free space"."""
    understood: tuple[tuple[str, str], ...] = ()
    """(phrase, what it was read as)."""
    unused: tuple[str, ...] = ()
    """Phrases that were not understood and have no effect."""
    origins: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Where each value comes from that is not None (see :mod:`rfgen_sionna.generative.decisions`)."""
    arms: str = ""
    """What the arms do beside the action, or empty."""
    sentence: str = ""
    """What the motion source reads itself, without distances, bodies and the like; empty where `action` says all."""
    avoid: str = ""
    """What the negative prompt says to a source that reads `sentence`."""
    notes: tuple[str, ...] = ()
    """Sentences about what is done instead of what was asked for."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each thing done instead and each phrase without effect."""
        return (*self.notes, *(f"prompt: {phrase!r} was not understood and has no effect" for phrase in self.unused))

    def decisions(self) -> list[Decision]:
        """Everything that is decided before there is a body: what words say, defaults, and what the seed drew."""
        known = ACTIONS.get(self.action)
        action = f"{self.action}: {known.description if known else 'as captured people do it'}"
        angle, bearing = self.orientation_deg or 0.0, self.bearing_deg or 0.0
        rows = [("target", f"a {self.target}"), ("action", action)]
        if self.arms:
            rows.append(("arms", f"{self.arms}: {ACTIONS[self.arms].description}"))
        if self.hand is not None:
            rows.append(("hand", self.hand))
        rows += [
            ("orientation", f"{angle:g}°{_FACING.get(angle, '')}"),
            ("distance", f"{DEFAULT_DISTANCE if self.distance_m is None else self.distance_m:g} m"),
            ("azimuth", f"{bearing:g}°{'' if bearing else ', straight ahead'}"),
            ("speed", f"× {1.0 if self.speed is None else self.speed:g}"),
            ("surroundings", self.surroundings or NOWHERE),
        ]
        found = [Decision(name, value, self.origins.get(name, DEFAULT)) for name, value in rows]
        for trait, value in self.body.traits().items():
            origin = self.origins.get(trait, drawn(self.seed))
            text = "open" if value is None else value if isinstance(value, str) else f"{value:g}{_UNITS[trait]}"
            found.append(Decision(trait, text, origin))
        return found

    def words(self) -> str:
        """Several lines: the phrases, and what each was read as."""
        lines = [f"prompt: {self.text}"]
        if self.negative:
            lines.append(f"negative: {self.negative}")
        width = max((len(phrase) for phrase, _ in self.understood), default=0)
        lines += [f"  {phrase:<{width}}  {meaning}" for phrase, meaning in self.understood]
        return "\n".join(lines)

    def report(self, decisions: Sequence[Decision] | None = None) -> str:
        """Several lines: what was understood and what was not, what is decided and where each value comes from.

        Args:
            decisions: what is known by now; None is :meth:`decisions`, in which a body that no words describe is
                still open.
        """
        lines = [self.words(), *(f"  {note}" for note in self.notes)]
        lines += [f"  not understood, no effect: {phrase}" for phrase in self.unused]
        lines += [DECIDED, *tabulate(self.decisions() if decisions is None else decisions)]
        return "\n".join(lines)
