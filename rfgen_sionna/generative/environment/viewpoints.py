"""Viewpoints of a radar in a furnished place, and their renders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.pir.projection import PROJECTIONS, Projection, check_fov, check_projection
from rfgen_sionna.pir.render import render_pir
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import FurnishedScene
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.tracer import Tracer

if TYPE_CHECKING:
    from rfgen_sionna.scene.mesh_actor import MeshActor

NEAREST = 0.35
"""Least distance of objects in view [m]."""
MEDIAN_DISTANCE = 0.9
"""Least median distance in view [m]."""
MAX_ATTEMPTS = 80
"""Random trials of a search; bounds its time."""
RENDER_RTOL = 1e-3
"""Tolerance of the tracer of images."""
FACET_WAVELENGTHS = 4.0
"""Size of the patches of coherent returns [wavelengths at 3 m]; enough for flat surfaces."""


@dataclass(frozen=True)
class ViewpointRanges:
    """Ranges of random views."""

    height: tuple[float, float] = (0.5, 2.0)
    """[m]"""
    pitch_deg: tuple[float, float] = (-8.0, 25.0)
    """Positive looks down."""
    fov_deg: tuple[float, float] = (40.0, 100.0)
    """Horizontal."""
    roll_deg: tuple[float, float] = (0.0, 0.0)
    """About the line of sight."""
    projections: tuple[Projection, ...] = PROJECTIONS[:1]
    """Equally probable projections."""

    def __post_init__(self) -> None:
        widest = 170.0 if "perspective" in self.projections else 360.0
        limits = (("height", 0.1, 20.0), ("pitch_deg", -89.0, 89.0), ("fov_deg", 1.0, widest), ("roll_deg", -180, 180))
        for name, low, high in limits:
            a, b = getattr(self, name)
            if not low <= a <= b <= high:
                raise ValueError(f"{name} is ({a}, {b}): a range within {low:g} … {high:g} is needed")
        if not self.projections:
            raise ValueError(f"projections is empty: some of {', '.join(PROJECTIONS)} are needed")
        for projection in self.projections:
            check_projection(projection)


@dataclass(frozen=True)
class Viewpoint:
    """Position and orientation of a view."""

    position: tuple[float, float, float]
    """[m]"""
    yaw: float
    """[rad], positive is to the left."""
    pitch: float
    """[rad], positive looks down."""
    fov_deg: float
    """Horizontal."""
    roll: float = 0.0
    """[rad]"""
    projection: Projection = "perspective"

    @property
    def orientation(self) -> tuple[float, float, float]:
        return self.yaw, self.pitch, self.roll

    def view(self, resolution: tuple[int, int]) -> View:
        """View with pixels (rows, columns)."""
        fov = check_fov(self.fov_deg, self.projection, resolution)
        return View(resolution, fov, self.position, self.orientation, self.projection)


class PlaceRenderer:
    """A place with a tracer for all its views; `radar` gives the band, `actors` are people in it."""

    def __init__(self, scene: FurnishedScene, radar: Radar, actors: Sequence[MeshActor] = ()) -> None:
        self.scene = scene
        self.tracer = Tracer(scene, radar, actors, RENDER_RTOL)

    @cached_property
    def rays(self) -> RayScene:
        return self.tracer.geometry(0.0)[0]

    def first_hits(self, viewpoint: Viewpoint, rows: int, columns: int) -> tuple[NDArray[np.int32], FloatArray]:
        """(pixel,) object at the middle of each pixel, −1 for none, and its distance [m]."""
        hits = self.rays.first_hit(viewpoint.position, viewpoint.view((rows, columns)).directions.reshape(-1, 3))
        return hits.object, hits.distance

    def in_view(self, objects: NDArray[np.int32], share: float = 0.004) -> list[str]:
        """Kinds that fill at least a share of an image, the largest first."""
        kinds = self.scene.kinds
        counts = Counter(kinds[i] for i in objects.tolist() if 0 <= i < len(kinds))
        return [kind for kind, count in counts.most_common() if count >= share * len(objects)]

    def render(self, viewpoint: Viewpoint, resolution: tuple[int, int], bounces: int = 1, t: float = 0.0) -> Pir:
        return render_pir(
            self.tracer,
            t,
            resolution,
            viewpoint.fov_deg,
            viewpoint.position,
            viewpoint.orientation,
            patch_wavelengths=FACET_WAVELENGTHS,
            bounces=bounces,
            indirect=False,
            projection=viewpoint.projection,
        )


def choose_viewpoint(renderer: PlaceRenderer, rng: np.random.Generator, ranges: ViewpointRanges) -> Viewpoint:
    """A random viewpoint on a free spot with an unobstructed view."""
    layout = renderer.scene.layout
    viewpoint = Viewpoint((0.0, 0.0, 1.0), 0.0, 0.0, 60.0)
    for _ in range(MAX_ATTEMPTS):
        height = float(rng.uniform(*ranges.height))
        if rng.random() < 0.25:  # as in a run: in front of a person
            x, y = float(rng.uniform(-0.2, 0.3)), float(rng.uniform(-0.3, 0.3))
            yaw = float(rng.uniform(-0.25, 0.25))
        else:
            x, y = (float(rng.uniform(a + 0.3, b - 0.3)) for a, b in layout.stand)
            yaw = _yaw_to_furniture(renderer, rng, x, y)
        viewpoint = Viewpoint(
            (x, y, height), yaw, float(np.radians(rng.uniform(*ranges.pitch_deg))), float(rng.uniform(*ranges.fov_deg))
        )
        if ranges.roll_deg != (0.0, 0.0) or len(ranges.projections) > 1:  # other data sets keep their random stream
            roll = float(np.radians(rng.uniform(*ranges.roll_deg)))
            viewpoint = replace(
                viewpoint, roll=roll, projection=ranges.projections[int(rng.integers(len(ranges.projections)))]
            )
        else:
            viewpoint = replace(viewpoint, projection=ranges.projections[0])
        if not layout.is_free(x, y, height, 0.25):
            continue
        objects, distance = renderer.first_hits(viewpoint, 12, 12)
        seen = np.where(objects >= 0, distance, 1e3)
        if seen.min() > NEAREST and np.median(seen) > MEDIAN_DISTANCE:
            return viewpoint
    return viewpoint


def _yaw_to_furniture(renderer: PlaceRenderer, rng: np.random.Generator, x: float, y: float) -> float:
    """Yaw [rad] roughly towards a piece of furniture, or the middle."""
    layout = renderer.scene.layout
    items = [item for item in layout.items if item.ground.bottom < 1.5]
    target = 0.5 * sum(layout.stand[0]), 0.5 * sum(layout.stand[1])
    if items and rng.random() < 0.75:
        near = np.array([1.0 / (2.0 + np.hypot(item.x - x, item.y - y)) ** 2 for item in items])
        item = items[int(rng.choice(len(items), p=near / near.sum()))]
        target = item.x, item.y
    return float(np.arctan2(target[1] - y, target[0] - x) + np.radians(rng.normal(0.0, 12.0)))
