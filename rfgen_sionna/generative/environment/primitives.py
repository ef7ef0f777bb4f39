"""Furnished places built of bricks: boxes and ellipsoids in any direction, a few for each piece of furniture.

A table is a top and four legs, a tree a stem and a crown, a car its wheels and a few blocks.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray

if TYPE_CHECKING:
    from rfgen_sionna.scene.furnished.furnished_scene import FurnishedScene

_OUT_OF_WALL = 0.12
"""Openings lie this far within their walls [m], whose bricks are whole: theirs are thicker."""
_OPENINGS = ("door", "window", "garage door")
_BEFORE_OTHERS = (*_OPENINGS, "path")
"""Parts of the shell that lie on others, which are whole without them."""
_SMALL, _SMALL_SHARE = 0.25, 0.3
"""Bodies that are smaller than this [m], and than this share of the piece, are built together: books, leaves."""
_MAX_PRIMITIVES = 48
"""Bodies of a piece that get bricks of their own."""
_HALVINGS = 3
"""A body is halved so many times ..."""
_SIMPLE = 40
"""... unless it has fewer faces, as boards and legs have, and ..."""
_WORTHWHILE_SHARE = 0.8
"""... if that leaves less than this share of the volume."""
_LEAST_THICKNESS = 0.02
"""Thickness that counts as none when volumes are compared [m]."""
_ROUND, _MOSTLY = 1.25, 0.98
"""Bodies of which so many points reach no further into the corners of their box, in half extents, are ellipsoids: not
larger than the box. A few leaves may stick out."""


@dataclass(frozen=True)
class Primitives:
    """Bodies in space, each about a centre along axes of its own."""

    centre: FloatArray
    """(brick, 3) [m]."""
    half: FloatArray
    """(brick, 3) half extents along its own axes [m]; some boxes are flat."""
    axes: FloatArray
    """(brick, 3, 3) its own axes, as rows."""
    round: NDArray[np.bool_]
    """(brick,) ellipsoids; the others are boxes."""

    def __len__(self) -> int:
        return len(self.centre)

    def __getitem__(self, index: slice | NDArray[np.integer] | NDArray[np.bool_]) -> Primitives:
        return Primitives(*(getattr(self, each.name)[index] for each in fields(self)))

    @classmethod
    def upright(cls, centre: FloatArray, half: FloatArray, yaw: FloatArray) -> Primitives:
        """Boxes (brick, 3) that are turned about the vertical alone, by (brick,) [rad]."""
        c, s, zero = np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))
        axes = np.stack([np.stack(row, -1) for row in ((c, s, zero), (-s, c, zero), (zero, zero, zero + 1.0))], 1)
        return cls(np.asarray(centre, np.float64), np.asarray(half, np.float64), axes, np.zeros(len(yaw), bool))

    @classmethod
    def joined(cls, parts: Iterable[Primitives]) -> Primitives:
        """All of them, one after the other."""
        listed = list(parts)
        return cls(*(np.concatenate([getattr(part, each.name) for part in listed]) for each in fields(cls)))

    @property
    def volume(self) -> float:
        """Of all of them [m^3], none of them thinner than `_LEAST_THICKNESS`."""
        sides = np.maximum(2.0 * self.half, _LEAST_THICKNESS)
        return float(np.sum(np.prod(sides, axis=1) * np.where(self.round, np.pi / 6.0, 1.0)))

    def own(self, points: FloatArray, index: NDArray[np.integer]) -> FloatArray:
        """Points (point, 3) [m] as coordinates of the bricks `index` (point,), in half extents; 0 along flat sides."""
        along = np.einsum("nij,nj->ni", self.axes[index], points - self.centre[index])
        half = self.half[index]
        return np.divide(along, half, out=np.zeros_like(along), where=half > 1e-6)

    def cast(self, position: Sequence[float], rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where rays (ray, 3) from a position meet each brick.

        Returns:
            (brick, ray) range [m] at which each ray enters, inf for never, and cosine of incidence. A ray that begins
            within a brick enters at 0 or less.
        """
        start = np.einsum("bij,bj->bi", self.axes, np.asarray(position) - self.centre)
        along = np.einsum("bij,rj->bir", self.axes, rays)
        inverse = 1.0 / np.where(np.abs(along) < 1e-12, 1e-12, along)
        one, other = ((sign * self.half - start)[..., None] * inverse for sign in (-1.0, 1.0))
        first = np.minimum(one, other)
        enters, leaves = first.max(axis=1), np.maximum(one, other).min(axis=1)
        facing = np.take_along_axis(np.abs(along), first.argmax(axis=1)[:, None], axis=1)[:, 0]
        if self.round.any():
            enters[self.round], leaves[self.round], facing[self.round] = _cast_at_ellipsoids(
                start[self.round], along[self.round], self.half[self.round]
            )
        return np.where((enters <= leaves) & (leaves > 0.0), enters, np.inf), facing


def _cast_at_ellipsoids(
    start: FloatArray, along: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where rays enter and leave ellipsoids, and cosine of incidence: the quadratic equation of unit spheres in half
    extents, from where the rays (brick, ray) start, (brick, 3), and go along, (brick, 3, ray)."""
    s, d = start / half, along / half[..., None]
    square, mixed = (d**2).sum(axis=1), np.einsum("bi,bir->br", s, d)
    inside = mixed**2 - square * ((s**2).sum(axis=1)[:, None] - 1.0)
    root = np.sqrt(np.maximum(inside, 0.0))
    enters, leaves = (-mixed - root) / square, (-mixed + root) / square
    leaves = np.where(inside > 0.0, leaves, -np.inf)
    normal = (s[..., None] + enters[:, None] * d) / half[..., None]
    facing = np.abs((normal * along).sum(axis=1)) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    return enters, leaves, facing


@dataclass(frozen=True)
class PrimitiveScene:
    """A furnished place of bricks."""

    bounding_boxes: Primitives
    """One upright box for each piece: a wall, a door, a sofa."""
    kinds: tuple[str, ...]
    """(piece,) what each is."""
    shell: int
    """How many are floor, walls, doors and windows; they come first."""
    parts: Primitives
    """What the pieces are built of, one after the other."""
    owner: NDArray[np.intp]
    """(part,) piece that each belongs to, ascending."""
    finishes: Mapping[str, str] = field(default_factory=dict)
    """What kinds are mostly made of, by names of :data:`~rfgen_sionna.scene.furnished.finishes.FINISHES`."""

    @classmethod
    def of(cls, scene: FurnishedScene) -> PrimitiveScene:
        """Each wall, and each part of doors and windows, as one box; furniture as a few bricks a piece."""
        bounding_boxes, kinds, parts = [], [], []
        for kind, points in scene.shell:
            if kind == "ground":  # of a meadow with its bumps: a plane
                points = points * (1.0, 1.0, 0.0)
            bounding_boxes.append(_fit_box(points, np.eye(3), _OUT_OF_WALL if kind in _OPENINGS else 0.0))
            kinds.append(kind)
            parts.append(bounding_boxes[-1])
        shell = len(kinds)
        for item in scene.layout.items:
            starts = np.cumsum([0] + [len(part.points) for part in item.parts[:-1]])
            points = np.concatenate([part.points for part in item.parts])
            faces = np.concatenate([part.faces + start for part, start in zip(item.parts, starts, strict=True)])
            yaw = np.radians(item.yaw)
            c, s = np.cos(yaw), np.sin(yaw)
            axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
            bounding_boxes.append(_fit_box(points, axes))
            kinds.append(item.kind)
            parts.append(fit_primitives(points, faces, axes))
        owner = np.repeat(np.arange(len(parts)), [len(each) for each in parts])
        return cls(
            Primitives.joined(bounding_boxes), tuple(kinds), shell, Primitives.joined(parts), owner, scene.finishes
        )

    def without(self, kinds: Collection[str]) -> PrimitiveScene:
        """The same place without pieces of some kinds; floor and walls stay. Nothing stands on pieces of furniture:
        what does, as books on shelves, is part of them."""
        left_out = np.array([kind in kinds for kind in self.kinds], bool)
        left_out[: self.shell] &= [kind in _BEFORE_OTHERS for kind in self.kinds[: self.shell]]
        if not left_out.any():
            return self
        kept, parts = np.flatnonzero(~left_out), ~left_out[self.owner]
        return PrimitiveScene(
            self.bounding_boxes[kept],
            tuple(self.kinds[piece] for piece in kept),
            int(np.sum(kept < self.shell)),
            self.parts[parts],
            np.searchsorted(kept, self.owner[parts]),
            self.finishes,
        )

    @classmethod
    def plain(cls, primitives: Primitives, kinds: tuple[str, ...], shell: int = 0) -> PrimitiveScene:
        """Of pieces that are one upright box each."""
        return cls(primitives, kinds, shell, primitives, np.arange(len(primitives)))


def fit_primitives(points: FloatArray, faces: IntArray, axes: FloatArray) -> Primitives:
    """A mesh, vertices (vertex, 3) [m] and faces (face, 3), of bricks along its own axes (3, 3) or along those of its
    parts: bodies that hang together are told apart, small ones go together, and what fills its box badly is halved."""
    corners = faces.ravel()
    joints = coo_matrix((np.ones(len(corners)), (corners, np.roll(faces, 1, axis=1).ravel())), [len(points)] * 2)
    _, label = connected_components(joints, directed=False)
    body = label[faces[:, 0]]
    order = np.argsort(body, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(body[order])) + 1)
    sizes = np.array([np.linalg.norm(np.ptp(points[faces[group].ravel()], axis=0)) for group in groups])
    small = sizes < min(_SMALL, _SMALL_SHARE * float(np.linalg.norm(np.ptp(points[corners], axis=0))))
    small[np.argsort(-sizes, kind="stable")[_MAX_PRIMITIVES:]] = True
    together = (
        [np.concatenate([g for g, is_small in zip(groups, small, strict=True) if is_small])] if small.any() else []
    )
    alone = [g for g, is_small in zip(groups, small, strict=True) if not is_small]
    return Primitives.joined(_fit_in_halves(points, faces[group], axes, _HALVINGS) for group in [*alone, *together])


def _fit_in_halves(points: FloatArray, faces: IntArray, axes: FloatArray, times: int) -> Primitives:
    """One brick around some faces, or several where they take much less room."""
    whole = _fit_tightest(points[np.unique(faces)], axes)
    if times == 0 or len(faces) < _SIMPLE or 2.0 * whole.half.max() < _SMALL:
        return whole
    longest = whole.axes[0, whole.half[0].argmax()]
    at = points[faces].mean(axis=1) @ longest
    first = at < whole.centre[0] @ longest
    if first.all() or not first.any():
        return whole
    halves = Primitives.joined(_fit_in_halves(points, faces[side], axes, times - 1) for side in (first, ~first))
    return halves if halves.volume < _WORTHWHILE_SHARE * whole.volume else whole


def _fit_tightest(points: FloatArray, axes: FloatArray) -> Primitives:
    """The smaller of the boxes along given axes and along the points' own, or the ellipsoid where that holds them."""
    best = _fit_box(points, axes)
    if len(points) >= 4:
        _, own = np.linalg.eigh(np.cov(points.T))
        turned = _fit_box(points, own.T[::-1])
        if turned.volume < _WORTHWHILE_SHARE * best.volume:
            best = turned
    if best.half[0].min() < 0.5 * _LEAST_THICKNESS:
        return best
    away = np.linalg.norm(best.own(points, np.zeros(len(points), np.intp)), axis=1)
    reach = float(np.quantile(away, _MOSTLY))
    return best if reach > _ROUND else Primitives(best.centre, reach * best.half, best.axes, np.ones(1, bool))


def _fit_box(points: FloatArray, axes: FloatArray, grown: float = 0.0) -> Primitives:
    own = points @ axes.T
    low, high = own.min(axis=0), own.max(axis=0)
    half = 0.5 * (high - low) + (grown, grown, 0.0)
    return Primitives((0.5 * (low + high) @ axes)[None], half[None], axes[None], np.zeros(1, bool))
