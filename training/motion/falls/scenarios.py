"""How bodies come to fall: the pushes, the hindered feet and the muscle tone of one fall, drawn from a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from training.motion.falls.starts import Start

AHEAD, LEFT, BACK, RIGHT = 0.0, 90.0, 180.0, -90.0
"""Directions, from where the person faces to the left [degrees]."""


@dataclass(frozen=True)
class Fade:
    """Muscle tone, as a share of that of standing, from 1 to `floor` between two times [s]."""

    start: float
    end: float
    floor: float

    def __call__(self, time: float) -> float:
        part = np.clip((time - self.start) / max(self.end - self.start, 1e-6), 0.0, 1.0)
        return float(1.0 - (1.0 - self.floor) * part * part * (3.0 - 2.0 * part))


@dataclass(frozen=True)
class Scenario:
    """One fall."""

    kind: str
    action: str
    start: Start
    size: float
    """Of the body, relative to the mean adult."""
    mass: float
    """[kg]"""
    direction: float
    """Of the fall from where the person faces [degrees]."""
    push: float = 0.0
    """Horizontal force on the chest [N]."""
    push_time: float = 0.0
    """[s]"""
    held: float = 0.0
    """Time for which an obstacle holds the swinging foot [s]."""
    slips: float = 0.0
    """Force between slipping foot and trunk that carries the foot ahead at first [N]; 0 for a floor that holds."""
    legs: Fade = field(default_factory=lambda: Fade(0.15, 0.6, 0.15))
    hips: Fade | None = None
    """As the legs if None."""
    trunk: Fade = field(default_factory=lambda: Fade(0.4, 1.1, 0.15))
    arms: Fade = field(default_factory=lambda: Fade(0.6, 1.2, 0.1))
    reach: float | None = None
    """Time at which the arms begin to reach for the floor [s]; None for arms that hang."""
    bend: Mapping[str, float] = field(default_factory=dict)
    """Flexion that hips and knees (and joints of the spine) take as they give way [degrees]."""
    uneven: float = 0.0
    """Share by which the left leg bends more, the right one less."""
    seat: str = ""
    """A "stool" or a "chair" with a back under or behind the person, or nothing."""
    seat_height: float = 0.0
    """Of a chair that stands behind the person [m]."""
    rest: float | None = 1.3
    """Time at which all tone has gone to that of a body at rest [s]; None for a body that keeps its posture."""


def draw(kind: str, starts: Mapping[str, Sequence[Start]], random: np.random.Generator) -> Scenario:
    """One scenario of a kind.

    Args:
        kind: one of `KINDS`.
        starts: "swing", "strike", "stand" and "sit": moments of clips to draw from.
        random: generator of all that is drawn.
    """
    size = float(np.clip(random.normal(1.0, 0.05), 0.9, 1.12))
    # body mass index 20 to 30: the girth of the shapes stays true enough
    mass = float(random.uniform(20.0, 30.0) * (1.70 * size) ** 2)
    place, values = KINDS[kind](random)
    uneven = random.uniform(-0.35, 0.35) * (0.1 if kind == "sink" else 1.0)
    among = starts[place]
    # a clip first, then one of its moments: long clips count no more than short ones
    names = sorted({each.clip.name for each in among})
    name = names[int(random.integers(len(names)))]
    own = [each for each in among if each.clip.name == name]
    start = own[int(random.integers(len(own)))]
    return Scenario(kind=kind, start=start, size=size, mass=mass, uneven=uneven, **values)


_Values = tuple[str, dict[str, Any]]


def _trip(random: np.random.Generator) -> _Values:
    legs = random.uniform(0.1, 0.3)
    return "swing", {
        "action": "fall_forward", "direction": AHEAD + random.normal(0.0, 8.0), "held": random.uniform(0.2, 0.4),
        "push": random.uniform(0.0, 150.0), "push_time": 0.2, "legs": Fade(legs, legs + random.uniform(0.3, 0.5), 0.12),
        "reach": random.uniform(0.12, 0.3), "bend": {"hip": random.uniform(15, 50), "knee": random.uniform(40, 90)},
    }  # fmt: skip


def _pushed(action: str, direction: float) -> Callable[[np.random.Generator], _Values]:
    def one(random: np.random.Generator) -> _Values:
        legs = random.uniform(0.2, 0.45)
        knee = random.uniform(20, 60)
        hip = {AHEAD: random.uniform(0, 40), BACK: random.uniform(15, 50)}.get(direction, random.uniform(0, 25))
        place = "stand" if direction in (AHEAD, BACK) or random.random() < 0.7 else "swing"
        return place, {
            "action": action, "direction": direction + random.normal(0.0, 10.0), "push": random.uniform(260.0, 540.0),
            "push_time": random.uniform(0.2, 0.35), "legs": Fade(legs, legs + random.uniform(0.25, 0.5), 0.12),
            "reach": random.uniform(0.15, 0.4), "bend": {"hip": hip, "knee": knee},
        }  # fmt: skip

    return one


def _slip(random: np.random.Generator) -> _Values:
    legs = random.uniform(0.2, 0.35)
    return "strike", {
        "action": "slip", "direction": BACK + random.normal(0.0, 12.0), "slips": random.uniform(100.0, 240.0),
        "legs": Fade(legs, legs + random.uniform(0.25, 0.45), 0.12), "reach": random.uniform(0.15, 0.35),
        "bend": {"hip": random.uniform(40, 75), "knee": random.uniform(10, 60)},
    }  # fmt: skip


def _faint(random: np.random.Generator) -> _Values:
    length = random.uniform(0.3, 0.6)
    loss = Fade(0.0, length, 0.02)
    return ("stand" if random.random() < 0.75 else "swing"), {
        "action": "faint", "direction": random.uniform(-180.0, 180.0), "push": random.uniform(5.0, 40.0),
        "push_time": 0.3, "legs": loss, "trunk": loss, "arms": loss,
        "bend": {"hip": random.uniform(30, 70), "knee": random.uniform(60, 110)}, "rest": length + 0.1,
    }  # fmt: skip


def _from_chair(random: np.random.Generator) -> _Values:
    length = random.uniform(0.25, 0.5)
    side = LEFT if random.random() < 0.5 else RIGHT
    trunk = random.uniform(0.6, 0.9)
    return "sit", {
        "action": "fall_from_chair", "direction": side + random.normal(0.0, 20.0), "push": random.uniform(180.0, 400.0),
        "push_time": random.uniform(0.3, 0.5), "legs": Fade(0.0, length, 0.03), "trunk": Fade(trunk, trunk + 0.4, 0.1),
        "arms": Fade(0.7, 1.2, 0.1), "reach": random.uniform(0.2, 0.5) if random.random() < 0.7 else None,
        "seat": "stool",
    }  # fmt: skip


def _sink(random: np.random.Generator) -> _Values:
    legs = random.uniform(0.15, 0.3)
    return "stand", {
        "action": "sit_down_heavily", "direction": BACK + random.normal(0.0, 3.0), "push": random.uniform(170.0, 270.0),
        "push_time": 0.35, "legs": Fade(legs, legs + random.uniform(0.15, 0.3), 0.06),
        "hips": Fade(legs, legs + 0.2, random.uniform(0.6, 0.9)), "trunk": Fade(0.3, 0.6, 0.9),
        "arms": Fade(0.3, 0.7, 0.25), "bend": {"hip": random.uniform(58, 78), "knee": random.uniform(75, 95)},
        "seat": "chair", "seat_height": random.uniform(0.42, 0.5), "rest": None,
    }  # fmt: skip


KINDS: Mapping[str, Callable[[np.random.Generator], _Values]] = MappingProxyType(
    {
        "trip": _trip,
        "forward": _pushed("fall_forward", AHEAD),
        "backward": _pushed("fall_backward", BACK),
        "left": _pushed("fall_sideways", LEFT),
        "right": _pushed("fall_sideways", RIGHT),
        "slip": _slip,
        "faint": _faint,
        "from_chair": _from_chair,
        "sink": _sink,
    }
)
"""Kinds of falls: where each begins, and its numbers."""
