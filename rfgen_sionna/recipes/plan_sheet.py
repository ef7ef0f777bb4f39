"""Sheet of sample scenes of a recipe: a floor plan and the shaded people of each, without any tracing."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from rfgen_sionna.recipes.making import IMPOSSIBLE, recording_plans
from rfgen_sionna.recipes.partitions import stream
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_spec import RecordingSpec
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.show.mesh_sheet import COLOURS, shaded_picture
from rfgen_sionna.show.style import INK, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rfgen_sionna.recording import RunPlan

COLUMNS = 4
"""Scenes in a row."""
MAX_HEIGHT = 2.0
"""Height above the floor up to which furniture is in the plan [m]: lamps and ceilings are not."""
MARGIN = 0.6
"""Margin around radars and people [m]."""
VIEW_DEG = 60.0
"""Half the angle of the wedge that shows where a radar looks [degrees]."""
OTHER_COLOUR = (0.6, 0.6, 0.6)
"""Red, green, blue of a material without a colour, 0 … 1."""
MAX_FACES = 30_000
"""Most faces of the furniture that are drawn, the largest ones."""


def sample_recordings(recipe: Recipe, count: int) -> list[RecordingSpec]:
    """Recordings of different places and actions, as far as there are that many."""
    left = list(stream(recipe.tables.seed, "sheet").permutation(recipe.count)[: 50 * count])
    specs = [recipe.recording(int(number)) for number in left]
    places: dict[str, int] = {}
    actions: dict[str, int] = {}
    chosen: list[RecordingSpec] = []
    while specs and len(chosen) < count:
        best = min(specs, key=lambda spec: (actions.get(spec.prompt, 0), places.get(spec.place, 0)))
        specs.remove(best)
        chosen.append(best)
        places[best.place] = places.get(best.place, 0) + 1
        actions[best.prompt] = actions.get(best.prompt, 0) + 1
    return sorted(chosen, key=lambda spec: (spec.place, spec.prompt))


def draw_sample_scenes(
    recipe: Recipe,
    path: Path,
    *,
    count: int = 12,
    dpi: int = 110,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a picture (PNG, PDF or SVG) of sample scenes: the floor plan with radars and ways, and the people.

    A scene whose placement cannot be is drawn by its next attempt, or with the reason.

    Args:
        recipe: the recipe.
        path: file to write.
        count: number of scenes.
        dpi: pixels per inch.
        progress: function of the number of finished and of all scenes.
    """
    specs = sample_recordings(recipe, count)
    columns = min(COLUMNS, len(specs))
    rows = -(-len(specs) // columns)
    figure = Figure((3.6 * columns, 2.5 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, 2 * columns, squeeze=False, width_ratios=[1.5, 1.0] * columns)
    for axes in grid.ravel():
        axes.set_axis_off()
    for index, spec in enumerate(specs):
        row, column = divmod(index, columns)
        plan, people = grid[row, 2 * column : 2 * column + 2]
        try:
            _draw(plan, people, *_first_that_can_be(recipe, spec))
        except ValueError as error:
            plan.text(0.0, 0.5, textwrap.fill(str(error), 34, max_lines=8), fontsize=6, va="center", color=INK)
        plan.set_title(f"{spec.name}  {spec.place}", loc="left", fontsize=8, color=INK, pad=3)
        people.set_title(textwrap.fill(spec.prompt, 26, max_lines=2), fontsize=7, color=MUTED, pad=3)
        if progress is not None:
            progress(index + 1, len(specs))
    figure.savefig(path, dpi=dpi)


def _first_that_can_be(recipe: Recipe, spec: RecordingSpec) -> tuple[RecordingSpec, list[RunPlan]]:
    for attempt in range(recipe.tables.attempts):
        try:
            again = recipe.recording(spec.number, attempt)
            return again, list(recording_plans(again).values())
        except IMPOSSIBLE:
            if attempt == recipe.tables.attempts - 1:
                raise
    raise AssertionError("unreachable")


def _draw(plan: Axes, people: Axes, spec: RecordingSpec, runs: list[RunPlan]) -> None:
    simulation = runs[0].simulation
    times = np.linspace(0.0, spec.duration_s, 9)
    points = [np.asarray(run.simulation.radar.position)[:2] for run in runs]
    _furniture(plan, runs[0])
    for actor in simulation.actors:
        way = np.array([actor.vertices(float(t))[:, :2].mean(axis=0) for t in times])
        first = actor.vertices(0.0)
        points += [first[:, :2].min(axis=0), first[:, :2].max(axis=0), *way]
        plan.scatter(first[::7, 0], first[::7, 1], s=0.4, color=_colours(actor).mean(axis=0)[None], zorder=3)
        plan.plot(*way.T, color=INK, linewidth=1.0, zorder=4)
    for run in runs:
        radar = run.simulation.radar
        x, y = radar.position[:2]
        ahead = np.arctan2(radar.rotation[1, 0], radar.rotation[0, 0])
        for side in (-1, 1):
            angle = ahead + side * np.radians(VIEW_DEG)
            plan.plot([x, x + 0.5 * np.cos(angle)], [y, y + 0.5 * np.sin(angle)], color=INK, linewidth=0.7, zorder=5)
        plan.scatter(x, y, s=14, marker="s", color=INK, zorder=6)
    low, high = np.min(points, axis=0) - MARGIN, np.max(points, axis=0) + MARGIN
    widest = max(high - low)
    middle = 0.5 * (low + high)
    plan.set_xlim(middle[0] - 0.5 * widest, middle[0] + 0.5 * widest)
    plan.set_ylim(middle[1] - 0.5 * widest, middle[1] + 0.5 * widest)
    plan.set_aspect("equal")
    plan.plot(*_bar(middle, widest), color=INK, linewidth=1.5, solid_capstyle="butt", zorder=7)
    plan.text(middle[0] - 0.45 * widest, middle[1] - 0.43 * widest, "1 m", fontsize=6, color=INK, zorder=7)
    if simulation.actors:
        people.imshow(_picture(simulation.actors, 0.5 * spec.duration_s, runs[0]), interpolation="antialiased")


def _bar(middle: np.ndarray, widest: float) -> tuple[list[float], list[float]]:
    x, y = middle[0] - 0.46 * widest, middle[1] - 0.46 * widest
    return [x, x + 1.0], [y, y]


def _furniture(axes: Axes, run: RunPlan) -> None:
    """Faces of the surroundings from above, below `MAX_HEIGHT`; higher ones are darker."""
    corners = [np.asarray(item.vertices)[np.asarray(item.faces)] for item in run.simulation.scene.objects]
    if not corners:
        return
    faces = np.concatenate(corners)
    faces = faces[(faces[..., 2].max(axis=1) < MAX_HEIGHT) & (faces[..., 2].max(axis=1) > 0.02)]
    size = np.ptp(faces[..., :2], axis=1).max(axis=1)
    faces = faces[np.argsort(size)[::-1][:MAX_FACES]]
    faces = faces[np.argsort(faces[..., 2].max(axis=1))]
    grey = 0.93 - 0.25 * np.clip(faces[..., 2].max(axis=1) / MAX_HEIGHT, 0.0, 1.0)
    shades = np.repeat(grey[:, None], 3, axis=1)
    axes.add_collection(PolyCollection(faces[..., :2], facecolors=shades, edgecolors=shades, linewidths=0.2, zorder=1))


def _colours(actor: MeshActor) -> np.ndarray:
    """(part, 3) colours of an actor's materials."""
    return np.array([COLOURS.get(each.name, OTHER_COLOUR) for each in actor.materials])


def _meshes(actors: tuple[MeshActor, ...], t: float) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    first = 0
    for actor in actors:
        points = np.asarray(actor.vertices(t))
        yield points, np.asarray(actor.faces) + first, _colours(actor)[actor.face_parts]
        first += len(points)


def _picture(actors: tuple[MeshActor, ...], t: float, run: RunPlan) -> np.ndarray:
    """Shaded picture of the actors as seen from beside the radar and above."""
    points, faces, colours = (np.concatenate(parts) for parts in zip(*_meshes(actors, t), strict=True))
    rotation = np.asarray(run.simulation.radar.rotation)
    # +x towards the eye: the radar sees them so
    towards = np.array([-rotation[:2, 0], -rotation[:2, 1]])
    turned = np.column_stack([points[:, :2] @ towards.T, points[:, 2]])
    return np.asarray(shaded_picture(turned, faces, colours, 25.0))
