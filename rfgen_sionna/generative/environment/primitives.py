"""Primitives: furnished places built of boxes and ellipsoids, a few for each piece of furniture.

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
"""Depth of openings within their walls [m]; thicker than the walls, so that they are in front."""
_OPENINGS = ("door", "window", "garage door")
_BEFORE_OTHERS = (*_OPENINGS, "path")
"""Parts of the shell that cover others."""
_SMALL, _SMALL_SHARE = 0.25, 0.3
"""Bodies below this size [m], and this share of the object, are fitted together: books, leaves."""
_MAX_PRIMITIVES = 48
"""Most bodies of an object that are fitted separately; bounds the cost of rays."""
_HALVINGS = 3
"""Most halvings of a body ..."""
_SIMPLE = 40
"""... not of one with fewer faces, as boards and legs have ..."""
_WORTHWHILE_SHARE = 0.8
"""... and only where the volume falls below this share."""
_LEAST_THICKNESS = 0.02
"""Thickness that counts as none in a volume [m]."""
_ROUND, _MOSTLY = 1.25, 0.98
"""Reach of an ellipsoid's points [half extents], and share of points within; a box has 1.7, a few leaves may be
outside."""


@dataclass(frozen=True)
class Primitives:
    """Boxes and ellipsoids."""

    centre: FloatArray
    """(primitive, 3) [m]."""
    half: FloatArray
    """(primitive, 3) half extents along its axes [m]; flat boxes have zeros."""
    axes: FloatArray
    """(primitive, 3, 3) axes, as rows."""
    round: NDArray[np.bool_]
    """(primitive,) ellipsoids; the others are boxes."""

    def __len__(self) -> int:
        return len(self.centre)

    def __getitem__(self, index: slice | NDArray[np.integer] | NDArray[np.bool_]) -> Primitives:
        return Primitives(*(getattr(self, each.name)[index] for each in fields(self)))

    @classmethod
    def upright(cls, centre: FloatArray, half: FloatArray, yaw: FloatArray) -> Primitives:
        """Boxes (primitive, 3) turned about the vertical by (primitive,) [rad]."""
        c, s, zero = np.cos(yaw), np.sin(yaw), np.zeros(len(yaw))
        axes = np.stack([np.stack(row, -1) for row in ((c, s, zero), (-s, c, zero), (zero, zero, zero + 1.0))], 1)
        return cls(np.asarray(centre, np.float64), np.asarray(half, np.float64), axes, np.zeros(len(yaw), bool))

    @classmethod
    def joined(cls, parts: Iterable[Primitives]) -> Primitives:
        """Concatenation."""
        listed = list(parts)
        return cls(*(np.concatenate([getattr(part, each.name) for part in listed]) for each in fields(cls)))

    @property
    def volume(self) -> float:
        """Total volume [m³], with a thickness of at least `_LEAST_THICKNESS`."""
        sides = np.maximum(2.0 * self.half, _LEAST_THICKNESS)
        return float(np.sum(np.prod(sides, axis=1) * np.where(self.round, np.pi / 6.0, 1.0)))

    def own(self, points: FloatArray, index: NDArray[np.integer]) -> FloatArray:
        """Points (point, 3) [m] in coordinates of the primitives `index` (point,), in half extents; 0 along flat
        sides."""
        along = np.einsum("nij,nj->ni", self.axes[index], points - self.centre[index])
        half = self.half[index]
        return np.divide(along, half, out=np.zeros_like(along), where=half > 1e-6)

    def cast(self, position: Sequence[float], rays: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Intersections of rays (ray, 3) from a position with each primitive.

        Returns:
            (primitive, ray) range [m] of entry, inf without intersection, 0 or less inside; and cosine of incidence.
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
    """Entry and exit of rays at ellipsoids, and cosine of incidence, from starts (primitive, 3) and directions
    (primitive, 3, ray) in half extents: quadratic equation of unit spheres."""
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
    """A furnished place of primitives."""

    bounding_boxes: Primitives
    """One upright box for each object: a wall, a door, a sofa."""
    kinds: tuple[str, ...]
    """(object,) kinds."""
    shell: int
    """Number of floor, walls, doors and windows; they come first."""
    parts: Primitives
    """Primitives of all objects in order."""
    owner: NDArray[np.intp]
    """(part,) object of each part, ascending."""
    finishes: Mapping[str, str] = field(default_factory=dict)
    """Main finish of each kind, by names of :data:`~rfgen_sionna.scene.furnished.finishes.FINISHES`."""

    @classmethod
    def of(cls, scene: FurnishedScene) -> PrimitiveScene:
        """Walls, doors and windows as one box a part; furniture as a few primitives a piece."""
        bounding_boxes, kinds, parts = [], [], []
        for kind, points in scene.shell:
            if kind == "ground":  # bumpy ground becomes a plane
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
        """The place without some kinds; floor and walls stay."""
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
        """Objects of one upright box each."""
        return cls(primitives, kinds, shell, primitives, np.arange(len(primitives)))


def fit_primitives(points: FloatArray, faces: IntArray, axes: FloatArray) -> Primitives:
    """Primitives of a mesh, vertices (vertex, 3) [m] and faces (face, 3), along given axes (3, 3) or its parts' own.

    Connected bodies are fitted separately, small ones together; poorly filled boxes are halved.
    """
    corners = faces.ravel()
    joints = coo_matrix((np.ones(len(corners)), (corners, np.roll(faces, 1, axis=1).ravel())), [len(points)] * 2)
    _, label = connected_components(joints, directed=False)
    body = label[faces[:, 0]]
    order = np.argsort(body, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(body[order])) + 1)
    sizes = np.array([np.linalg.norm(np.ptp(points[faces[group].ravel()], axis=0)) for group in groups])
    small = sizes < min(_SMALL, _SMALL_SHARE * float(np.linalg.norm(np.ptp(points[corners], axis=0))))
    small[np.argsort(-sizes, kind="stable")[_MAX_PRIMITIVES:]] = True
    alone = [g for g, is_small in zip(groups, small, strict=True) if not is_small]
    if small.any():
        alone.append(np.concatenate([g for g, is_small in zip(groups, small, strict=True) if is_small]))
    return Primitives.joined(_fit_in_halves(points, faces[group], axes, _HALVINGS) for group in alone)


def _fit_in_halves(points: FloatArray, faces: IntArray, axes: FloatArray, times: int) -> Primitives:
    """One primitive around some faces, or several of much less volume."""
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
    """The smaller of the boxes along given axes and along principal axes, or an ellipsoid where it holds the points."""
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
