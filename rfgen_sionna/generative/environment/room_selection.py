"""Selection of a furnished place for a prompt: one with the requested objects, and a free spot for the radar.

Layouts have seeds of their own (:data:`FIRST_SEED`), outside all training and test data.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.layout_map import LayoutMap, render_layout_map
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.generative.environment.viewpoints import MEDIAN_DISTANCE, NEAREST
from rfgen_sionna.pir.view import View
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.furnished.furnished_scene import FurnishedScene
from rfgen_sionna.scene.scene_errors import PlacementError

FIRST_SEED = 1 << 40
"""First seed of imagined layouts."""
LAYOUTS = 16
"""Most layouts in a search; bounds its time, as the next three."""
MAX_BUILT = 8
"""Most layouts that are built of primitives."""
POSITIONS_PER_LAYOUT = 24
"""Radar positions that are tried in a layout."""
VIEWS_PER_LAYOUT = 8
"""Most views that are rendered in a layout."""
_COARSE = (24, 24)
_SHELL = ("floor", "ceiling", "far wall", "near wall", "left wall", "right wall")
"""Surfaces whose finish words may name."""
_MARGIN = 0.25
"""Free space around a radar [m]."""
_POINTING_SPREAD = np.radians(12.0)
"""Standard deviation of the yaw towards furniture [rad], as in the data sets."""
_RANDOM_DIRECTION_SHARE = 0.25
"""Share of the views in a random direction."""
_IN_FRONT, _STRAIGHT, _NEAR = 0.25, 0.25, 0.3
"""Share of the views as in a run, and their largest yaw [rad] and distance from the origin [m]."""


@dataclass(frozen=True)
class PlaceRequest:
    """Requested place."""

    place: str
    things: tuple[tuple[str, ...], ...] = ()
    """Requested objects in view: for each, its possible kinds."""
    without: tuple[str, ...] = ()
    """Absent kinds."""
    surfaces: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """Walls, floors and ceilings, with their possible finishes."""

    def excludes(self, kind: str) -> bool:
        """Whether a kind is excluded: "chair" excludes an office chair, unless that is requested."""
        wanted = any(kind in meant for meant in self.things)
        return kind in self.without or (not wanted and any(_is(kind, excluded) for excluded in self.without))

    def wants(self, kind: str) -> bool:
        """Whether a kind is requested: "chair" includes an office chair."""
        return any(_is(kind, each) for meant in self.things for each in meant)

    def met(self, kinds: Collection[str]) -> list[bool]:
        """Whether each requested object is among `kinds`."""
        return [any(_is(kind, each) for kind in kinds for each in meant) for meant in self.things]

    def made(self, finishes: Mapping[str, str]) -> list[bool]:
        """Whether each requested surface has its finish, from the `finishes` by kind."""
        return [
            any(finish in meant for kind, finish in finishes.items() if kind in _SHELL and _is(kind, surface))
            for surface, meant in self.surfaces
        ]


def _is(kind: str, other: str) -> bool:
    return kind == other or kind.endswith(f" {other}")


@dataclass(frozen=True)
class Room:
    """A place of primitives, and the caller's origin in it."""

    place: PrimitiveScene
    offset: tuple[float, float]
    """Position of the caller's origin in the place [m]."""
    inside: tuple[tuple[float, float], tuple[float, float], tuple[float, float]] | None = None
    """Bounds of x, y and z within the walls [m]; None outdoors."""

    def layout_from(self, view: View) -> LayoutMap:
        """Layout map of a view in the caller's world."""
        return render_layout_map(self.place, self.moved(view))

    def check(self, view: View) -> None:
        """Check a radar position.

        Raises:
            PlacementError: it is outside walls, floor or ceiling.
        """
        if self.inside is None:
            return
        place = self.moved(view).position
        if all(low < at < high for at, (low, high) in zip(place, self.inside, strict=True)):
            return
        ends = zip(self.inside, (*self.offset, 0.0), strict=True)
        limits = ", ".join(f"{low - off:.2f} … {high - off:.2f}" for (low, high), off in ends)
        raise PlacementError(
            f"position: {tuple(float(x) for x in view.position)} m is outside of the room that was imagined from its "
            f"first view; x, y and z in {limits} m are inside"
        )

    def moved(self, view: View) -> View:
        """The view in the world of the place."""
        x, y, z = view.position
        return replace(view, position=(x + self.offset[0], y + self.offset[1], z))


@lru_cache(maxsize=256)
def choose_room(wanted: PlaceRequest, view: View, seed: int, *, anywhere: bool = False) -> Room:
    """Of a few places, the one that shows most of the request.

    Args:
        wanted: the request.
        view: first view, in the caller's world with the floor at z = 0.
        seed: of the layouts.
        anywhere: whether the radar may stand anywhere in the place. Otherwise the caller's origin is the place's, with
            free space for a person before it (1.2 … 4.3 m along x), as long as the radar's spot is free.

    Raises:
        ValueError: there is no free spot at the radar's height.
    """
    rng = np.random.default_rng([seed, 107])
    best: tuple[float, Room] | None = None
    enough, built = float(len(wanted.things) + len(wanted.surfaces)), 0
    for number in range(LAYOUTS):
        scene = furnished(wanted.place, FIRST_SEED + LAYOUTS * seed + number)
        held = {*scene.layout.kinds, *(kind for kind, _ in scene.shell)}
        made = sum(wanted.made(scene.finishes))
        if best is not None and sum(wanted.met(held)) + made <= best[0]:
            continue  # cannot be better
        place = PrimitiveScene.of(scene)
        place = place.without([kind for kind in set(place.kinds) if wanted.excludes(kind)])
        for offset in _offsets(scene, view, rng, anywhere):
            room = Room(place, offset, _inside(scene))
            score = _score(room, replace(view, resolution=_COARSE), wanted)
            if score >= enough:
                score = _score(room, view, wanted)  # a coarse look may be wrong about small things
            score -= 5.0 * (not anywhere and offset != (0.0, 0.0))
            if best is None or score > best[0]:
                best = score, room
            if score >= enough:
                return room
        built += 1
        if built >= MAX_BUILT and best is not None:
            break
    if best is None:
        limit = f"; the ceiling of the last is {scene.layout.height:.2f} m high" if scene.layout.indoors else ""
        raise PlacementError(
            f"position: {view.position[2]:g} m high, and none of {LAYOUTS} layouts of the kind {wanted.place!r} has a "
            f"free spot for a radar there{limit}"
        )
    return best[1]


def _offsets(
    scene: FurnishedScene, view: View, rng: np.random.Generator, anywhere: bool
) -> Iterator[tuple[float, float]]:
    """Candidate positions of the caller's origin: the place's own, or with the radar on a free spot."""
    if not anywhere and _may_stand(scene, view):
        yield 0.0, 0.0
        return
    for _ in range(VIEWS_PER_LAYOUT):
        found = _sample_position(scene, view, rng)
        if found is None:
            return
        yield found[0] - view.position[0], found[1] - view.position[1]


def _score(room: Room, view: View, wanted: PlaceRequest) -> float:
    """Number of requested objects in a view, with a penalty for near obstacles."""
    layout_map = room.layout_from(view)
    kinds = layout_map.kinds(room.place)
    reach = np.where(np.isfinite(layout_map.range), layout_map.range, 1e3)
    blocked = bool(reach.min() < NEAREST or np.median(reach) < MEDIAN_DISTANCE)
    return sum(wanted.met(kinds)) + sum(wanted.made(room.place.finishes)) - 10.0 * blocked


def _inside(scene: FurnishedScene) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]] | None:
    layout = scene.layout
    return (layout.x, layout.y, (0.0, layout.height)) if layout.indoors else None


def _may_stand(scene: FurnishedScene, view: View) -> bool:
    x, y, z = view.position
    return scene.layout.is_free(x, y, z, _MARGIN)


def _sample_position(scene: FurnishedScene, view: View, rng: np.random.Generator) -> tuple[float, float] | None:
    """Free radar position for a yaw, usually towards furniture; None without one."""
    layout = scene.layout
    # probability of a view as in a run, given the yaw
    straight = _IN_FRONT / (2 * _STRAIGHT) * (abs(view.orientation[0]) < _STRAIGHT)
    if rng.uniform() < straight / (straight + (1 - _IN_FRONT) / (2 * np.pi)):
        x, y = (float(rng.uniform(-_NEAR, _NEAR)) for _ in range(2))
        if layout.is_free(x, y, view.position[2], _MARGIN):
            return x, y
    items = [(item.x, item.y) for item in layout.items if item.ground.bottom < 1.5]
    targets = np.array(items or [(0.5 * sum(layout.stand[0]), 0.5 * sum(layout.stand[1]))])
    spots, weights = [], []
    for _ in range(POSITIONS_PER_LAYOUT):
        x, y = (float(rng.uniform(a + 0.3, b - 0.3)) for a, b in layout.stand)
        if not layout.is_free(x, y, view.position[2], _MARGIN):
            continue
        away = targets - (x, y)
        near = 1.0 / (2.0 + np.hypot(*away.T)) ** 2
        spots.append((x, y))
        pointing = float(near @ _pointing_density(away, view.orientation[0]) / near.sum())
        weights.append(_RANDOM_DIRECTION_SHARE / (2 * np.pi) + pointing)
    if not spots:
        return None
    probabilities = np.array(weights)
    return spots[int(rng.choice(len(spots), p=probabilities / probabilities.sum()))]


def _pointing_density(away: FloatArray, yaw: float) -> FloatArray:
    """Density of a yaw for views that point at each of `away` (target, 2)."""
    off = (yaw - np.arctan2(away[:, 1], away[:, 0]) + np.pi) % (2 * np.pi) - np.pi
    return np.asarray(np.exp(-0.5 * (off / _POINTING_SPREAD) ** 2) / (_POINTING_SPREAD * np.sqrt(2 * np.pi)))
