"""Dogs, cats, horses and birds: tubes along the joints of animated clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.things.animal_clips import AnimalClip, JointPath, animal_clips
from rfgen_sionna.generative.things.articulated import ArticulatedSequence, ThingPart
from rfgen_sionna.generative.things.generalized_cylinders import TubePath, tube
from rfgen_sionna.generative.things.part_motion import Curve, Swing
from rfgen_sionna.generative.things.thing_kind import BuildRequest
from rfgen_sionna.scene.materials import material


@dataclass(frozen=True)
class BodyTube:
    """A tube of an animal, in metres at the size of its clips."""

    part: str
    chain: Sequence[str | Mapping[str, float]]
    """Joints, or weights of joints that sum to 1."""
    wide: Sequence[float]
    """Half the width at each [m]."""
    deep: Sequence[float] | None = None
    """Half the depth at each [m]; None is round."""
    across: tuple[float, float, float] | Sequence[Mapping[str, float]] = (0.0, 1.0, 0.0)
    """Direction of the width, or for each of the chain the weights of a difference of joints along the depth."""


@dataclass(frozen=True)
class AnimalBody:
    """Body on the skeleton of an animal's clips."""

    clips: str
    """Animal of the clips."""
    tubes: Sequence[BodyTube]
    size: float
    """Size of the clips' animal, in the unit of the size parameter [m]."""
    foot: float
    """Radius of a foot [m]: joints of toes are so high over the floor."""
    changes: Mapping[str, tuple[str, float]]
    """Joint -> (joint, factor) of stretched distances: proportions of another animal."""


def pairs(tubes: Sequence[BodyTube], left: str = "_L", right: str = "_R") -> list[BodyTube]:
    """Tubes of the left side, and those of the right one."""

    def opposite(name: str) -> str:
        return name.removesuffix(left) + right if name.endswith(left) else name

    def weights(point: Mapping[str, float]) -> dict[str, float]:
        return {opposite(name): weight for name, weight in point.items()}

    found = []
    for each in tubes:
        across = each.across if isinstance(each.across, tuple) else [weights(way) for way in each.across]
        chain = [opposite(point) if isinstance(point, str) else weights(point) for point in each.chain]
        found += [
            BodyTube(f"left {each.part}", each.chain, each.wide, each.deep, each.across),
            BodyTube(f"right {each.part}", chain, each.wide, each.deep, across),
        ]
    return found


@dataclass(frozen=True, eq=False)
class AnimalMotion:
    """Joint positions of an animal of its own size and proportions over time."""

    clip: AnimalClip
    shape: FloatArray
    """(joint, joint) matrix of the proportions."""
    scale: float
    clip_time: Curve
    """Time of the clip [s] at a time [s]."""
    lift: float
    """Height of the toes' joints over the floor [m]."""

    def __call__(self, t: float) -> FloatArray:
        joints = self.scale * (self.shape @ self.clip.joints(self.clip_time(t)))
        joints[:, 2] += self.lift
        return joints


@dataclass(frozen=True, eq=False)
class BlendedMotion:
    """Change from one motion in place to another."""

    first: AnimalMotion
    second: AnimalMotion
    share: Swing
    """Share of the second one."""

    def __call__(self, t: float) -> FloatArray:
        share = self.share(t)
        return (1.0 - share) * self.first(t) + share * self.second(t)


CHANGES = {"sit_down": ("stand", "sit"), "stand_up": ("sit", "stand")}
"""Action -> actions before and after it."""
_CHANGE = Swing(0.0, 1.0, 0.4, 1.0)
HELD = {"lie": "fall_over"}
"""Action -> action whose last pose it holds."""


@dataclass(frozen=True)
class Pace:
    """Time of a clip [s]: by the distance travelled, or by a rate."""

    travelled: Curve | None
    rate: float
    """Seconds of the clip per metre, or per second."""
    start: float
    """[s]"""

    def __call__(self, t: float) -> float:
        return self.start + self.rate * (t if self.travelled is None else self.travelled(t))


def froude_speed(body: AnimalBody, action: str, size: float) -> float:
    """Speed of a gait [m/s] at a size [m]: as the root of the length, at equal Froude number."""
    return animal_clips()[body.clips, action].forward_speed * float(np.sqrt(size / body.size))


def animal(
    body: AnimalBody,
    request: BuildRequest,
    *,
    size: float,
    girth: float = 1.0,
    coat: str = "skin",
    wing_beats: tuple[float, int] | None = None,
) -> ArticulatedSequence:
    """An animal.

    Args:
        body: body and clips.
        request: action, distance and random numbers.
        size: in the unit of `body.size` [m].
        girth: factor on all widths.
        coat: material.
        wing_beats: wing beats per second [Hz] in flight, and in the clip of flight; None has no wings.
    """
    first, last = CHANGES.get(request.action, (HELD.get(request.action, request.action),) * 2)
    clip = animal_clips()[body.clips, first]
    index = {name: k for k, name in enumerate(clip.joint_names)}
    shape = np.eye(len(index))
    for name, (origin, factor) in body.changes.items():
        shape[index[name], index[name]] = factor
        shape[index[name], index[origin]] = 1.0 - factor
    scale = size / body.size
    start = float(request.rng.random()) * clip.length if clip.cyclic else 0.0
    if request.action in HELD:
        start = 2.0 * clip.length
    walks = clip.forward_speed > 0.0
    if walks:
        rate = 1.0 / (clip.forward_speed * scale)
    elif wing_beats is not None and clip.cyclic and request.action != "stand":
        rate = wing_beats[0] * clip.length / wing_beats[1]
    else:
        rate = 1.0 / float(np.sqrt(scale))
    pace = Pace(request.travelled if walks else None, rate, start)
    lift = scale * body.foot * girth
    before = AnimalMotion(clip, shape, scale, pace, lift)
    motion: JointPath = before
    if last != first:
        after = AnimalMotion(animal_clips()[body.clips, last], shape, scale, pace, lift)
        motion = BlendedMotion(before, after, _CHANGE)
    rest = AnimalMotion(animal_clips()[body.clips, "stand"], shape, scale, Pace(None, 0.0, 0.0), 0.0)(0.0)
    parts = []
    skin = material(coat)
    for each in body.tubes:
        points = np.zeros((len(each.chain), len(index)))
        for row, point in enumerate(each.chain):
            for name, weight in ({point: 1.0} if isinstance(point, str) else point).items():
                points[row, index[name]] += weight
        across: FloatArray = np.asarray(each.across if isinstance(each.across, tuple) else ())
        if not isinstance(each.across, tuple):
            across = np.zeros((len(each.across), len(index)))
            for row, way in enumerate(each.across):
                for name, weight in way.items():
                    across[row, index[name]] += weight
        factor = scale * girth
        deep = None if each.deep is None else [factor * d for d in each.deep]
        widest = max(max(each.wide), max(each.deep or (0.0,)))
        made = tube(
            points,
            rest,
            [factor * w for w in each.wide],
            deep,
            across=across,
            step=0.5 * factor * max(widest, 0.03),
            sides=14 if widest < 0.08 * body.size else 28,
        )
        parts.append(ThingPart(each.part, TubePath(made, motion), made.faces, skin))
    return ArticulatedSequence(parts, clip.joint_names, motion)
