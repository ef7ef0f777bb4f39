"""Bodies of round and flat tubes along chains of joints: closed meshes that follow the joints smoothly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.furnished.shapes import loft

_CAP = 4
"""Rings of a round end."""


@dataclass(frozen=True, eq=False)
class Tube:
    """Elliptic sections along a curve through joints, with round ends.

    Vertices are smooth functions of the joint positions as long as `across` is nowhere along the curve.
    """

    weights: FloatArray
    """(ring, joint) weights of the joints for the centre of each ring."""
    wide: FloatArray
    """(ring,) half the width, along `across` [m]."""
    deep: FloatArray
    """(ring,) half the depth, normal to `across` and curve [m]."""
    sides: int
    """Points of a ring."""
    across: ArrayLike
    """(3,) direction of the width, or (ring, joint) weights of a difference of joints along the depth."""

    @cached_property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices."""
        return loft(np.zeros((len(self.weights) + 2 * _CAP, self.sides, 3))).faces

    def points(self, joints: FloatArray) -> FloatArray:
        """(vertex, 3) positions [m] for joints (joint, 3) [m]."""
        centres = self.weights @ joints
        along = _unit(np.gradient(centres, axis=0))
        given = np.asarray(self.across, np.float64)
        if given.shape == (3,):
            side = _unit(given - (along @ given)[:, None] * along)
            normal = np.cross(along, side)
        else:
            depth = given @ joints
            normal = _unit(depth - np.sum(depth * along, axis=1, keepdims=True) * along)
            side = np.cross(normal, along)
        angle = 2.0 * np.pi * np.arange(self.sides) / self.sides
        round_ = (
            self.wide[:, None, None] * np.cos(angle)[:, None] * side[:, None]
            + self.deep[:, None, None] * np.sin(angle)[:, None] * normal[:, None]
        )
        lift = np.sin(0.5 * np.pi * (np.arange(_CAP) + 1) / (_CAP + 0.5))
        shrink = np.sqrt(1.0 - lift**2)
        ends = []
        for ring, sign in ((0, -1.0), (-1, 1.0)):
            height = sign * min(self.wide[ring], self.deep[ring]) * lift[:, None, None]
            ends.append(centres[ring] + height * along[ring] + shrink[:, None, None] * round_[ring])
        rings = np.concatenate([ends[0][::-1], centres[:, None] + round_, ends[1]])
        return np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])


def tube(
    chain: FloatArray,
    rest: FloatArray,
    wide: Sequence[float],
    deep: Sequence[float] | None = None,
    *,
    across: ArrayLike = (0.0, 1.0, 0.0),
    step: float,
    sides: int,
) -> Tube:
    """A tube through points, which are weighted joints.

    Args:
        chain: (point, joint) weights, two points or more.
        rest: (joint, 3) positions at rest [m], which space the rings.
        wide, deep: half the width and half the depth at each point [m]; None is round.
        across: (3,) direction of the width, or (point, joint) weights of a difference of joints along the depth.
        step: distance between rings [m].
        sides: points of a ring.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain @ rest, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(3, round(length[-1] / step) + 1))
    if len(chain) > 2:
        curve = CubicSpline(length, np.eye(len(chain)), bc_type="natural")(at)
    else:
        curve = np.stack([1.0 - at / at[-1], at / at[-1]], axis=1)

    def radii(values: Sequence[float]) -> FloatArray:
        return np.asarray(PchipInterpolator(length, np.asarray(values, np.float64))(at))

    way = np.asarray(across, np.float64)
    way = way if way.shape == (3,) else curve @ way
    return Tube(curve @ chain, radii(wide), radii(wide if deep is None else deep), sides, way)


@dataclass(frozen=True, eq=False)
class TubePath:
    """Vertices of a tube over time."""

    tube: Tube
    joints: Callable[[float], FloatArray]
    """(joint, 3) positions [m] at a time [s]."""

    def __call__(self, t: float) -> FloatArray:
        return self.tube.points(self.joints(t))


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
