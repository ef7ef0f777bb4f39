"""Scenes that two checkouts simulate side by side, and what is asked of the later one (`against.py`).

Scenes take nothing but the public names that checkouts have in common; the package is imported where a scene is made,
from the checkout of the process. This module stands alone, so that processes of any checkout can read it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Overrides = dict[str, Any]
TOWARDS_X: Overrides = {"position": (0, 0, 1), "look_at": (3, 0, 1)}
BEFORE_WALL: Overrides = {"position": (-1.8, 0.3, 1.2), "look_at": (0.0, 0.3, 1.0)}
SHORT: Overrides = {"preset.mmmesh.num_loops": 32, "preset.mmmesh.num_samples": 128}
"""A short frame of the AWR1843."""
FAR: Overrides = {"preset.mmmesh.slope_hz_per_s": 15.003e12}
"""A range window of 44 m."""
WALK = "a person walking back and forth, at 3 m"
PANE = """<scene version="2.1.0">
<bsdf type="itu-radio-material" id="glass">
<string name="type" value="glass"/><float name="thickness" value="0.006"/></bsdf>
<shape type="ply" id="mesh-pane"><string name="filename" value="{}"/><ref id="glass" name="bsdf"/>
<transform name="to_world"><rotate y="1" angle="90"/><translate x="1" z="1"/></transform></shape></scene>
"""


@dataclass(frozen=True)
class Setting:
    """What a Simulator is made of, and when its frames begin."""

    scene: Any
    radar: Any
    actors: tuple[Any, ...]
    start: float = 0.0
    """Start of the first frame [s]."""
    options: dict[str, Any] = field(default_factory=dict)
    """Further arguments of the Simulator."""
    held: Any = None
    """What has to last as long as the setting, such as a folder of files that are read later."""

    def simulator(self, rtol: float | None) -> Any:
        """The simulator at a tolerance; None is its own default."""
        import rfgen_sionna as rfgen

        given = {} if rtol is None else {"rtol": rtol}
        return rfgen.Simulator(self.scene, self.radar, self.actors, **given, **self.options)


@dataclass(frozen=True)
class Speed:
    """A scene whose frames are timed, and what is asked of the new checkout."""

    make: Callable[[], Setting]
    title: str
    factor: float | None = None
    """Least ratio of the CPU times of a later frame, old to new."""
    most_first: float | None = None
    """Most CPU seconds of the first frame of a fresh process."""
    most_later: float | None = None
    """Most CPU seconds of a later frame."""
    asked_for: bool = False
    """Whether it is left out unless it is named: minutes in an old checkout."""


@dataclass(frozen=True)
class Error:
    """A scene whose samples are compared."""

    make: Callable[[], Setting]
    title: str
    frames: int = 1
    people: bool = False
    """Whether the quads of its people's meshes are cut along the other diagonal, too."""


def awr1843(short: bool = False, more: Overrides | None = None, **pose: Any) -> Any:
    import rfgen_sionna as rfgen

    overrides = (SHORT if short else {}) | (more or {})
    return rfgen.Radar.load("awr1843", preset="mmmesh", overrides=overrides, **(pose or TOWARDS_X))


def ball(name: str, position: tuple[float, float, float], radius: float = 0.1, **options: Any) -> Any:
    import trimesh

    import rfgen_sionna as rfgen

    sphere = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return rfgen.Actor.from_mesh(sphere, material="pec", name=name, position=position, **options)


def of_prompt(prompt: str, radar: Any, **options: Any) -> Any:
    import rfgen_sionna as rfgen

    return rfgen.Actor.from_prompt(prompt, radar=radar, **({"seed": 0} | options))


def scene_of(name: str | Path) -> Any:
    import rfgen_sionna as rfgen

    return rfgen.load_scene(name)


def walk(short: bool = False, scene: str | None = None, duration: float = 3.0) -> Setting:
    radar = awr1843(short)
    actors = (of_prompt(WALK, radar, duration=duration),)
    options = {"collisions": "ignore"} if scene else {}
    return Setting(scene_of(scene) if scene else None, radar, actors, 0.45, options)


def hand(short: bool = False) -> Setting:
    """A push, at the time at which the hand comes to 0.3 m."""
    import rfgen_sionna as rfgen

    loops = {"preset.di_gesture.num_loops": 16} if short else {}
    radar = rfgen.Radar.load("awr1843", "di_gesture", position=(0, 0, 1.2), look_at=(1, 0, 1.2), overrides=loops)
    actor = of_prompt("a person pushing with the right hand, at 0.9 m", radar)
    times = np.linspace(0, 3, 61)
    away = [np.linalg.norm(actor.vertices(t) - radar.position, axis=1).min() for t in times]
    return Setting(None, radar, (actor,), float(times[np.argmin(np.abs(np.array(away) - 0.3))]))


def breather() -> Setting:
    """Frames of two chirps, 20 times a second."""
    import rfgen_sionna as rfgen

    loops = {"preset.range_doppler.num_loops": 2, "preset.range_doppler.frame_period_s": 0.05}
    radar = rfgen.Radar.load("bgt60tr13c", "range_doppler", overrides=loops, **TOWARDS_X)
    words = "a person stands still and breathes 15 times a minute, at 1.5 m"
    return Setting(None, radar, (of_prompt(words, radar),), 0.45)


def car(short: bool = False) -> Setting:
    radar = awr1843(short, FAR)
    return Setting(None, radar, (of_prompt("a car drives towards the radar at 5 m/s, at 20 m", radar),), 0.45)


def dog() -> Setting:
    radar = awr1843()
    return Setting(None, radar, (of_prompt("a dog walking, at 3 m", radar),), 0.45)


def two_people() -> Setting:
    radar = awr1843()
    beside = "a person doing jumping jacks, at 3.5 m, at azimuth 25 degrees"
    walker = of_prompt("a person walking back and forth, at 3 m, at azimuth -15 degrees", radar, name="first")
    return Setting(None, radar, (walker, of_prompt(beside, radar, seed=1, name="second")), 0.45)


def canyon() -> Setting:
    radar = awr1843(more=FAR, position=(0, 0, 1.5), look_at=(20, 0, 1))
    walker = of_prompt("a person walking back and forth, at 8 m, at azimuth 15 degrees", radar, name="pedestrian")
    driver = of_prompt("a car drives towards the radar at 5 m/s, at 20 m", radar, name="car")
    return Setting(scene_of("simple_street_canyon"), radar, (walker, driver), 0.45, {"collisions": "ignore"})


def tiny() -> Setting:
    """A coarse ball and a short frame."""
    radar = awr1843(more={"preset.mmmesh.num_loops": 4, "preset.mmmesh.num_samples": 32})
    return Setting(None, radar, (ball("ball", (2.0, 0.1, 1.0), velocity=(1, 0, 0)),))


def jacks(scene: str | None = None) -> Setting:
    radar = awr1843(True)
    actors = (of_prompt("a person doing jumping jacks, at 3 m", radar),)
    return Setting(scene_of(scene) if scene else None, radar, actors, 0.4)


def ghosts() -> Setting:
    balls = (ball("ball", (-0.6, 0.3, 1.2), velocity=(-1, 0, 0)), ball("other", (-0.7, 0.7, 1.2)))
    return Setting(scene_of("floor_wall"), awr1843(True, **BEFORE_WALL), balls, options={"max_bounces": 3})


def corner() -> Setting:
    """A moving trihedral of 10 cm."""
    import rfgen_sionna as rfgen

    e = 0.1 * np.eye(3)
    turn = np.array([[-1, -1, -1], [1, -1, 0], [1, 1, -2]]) / np.sqrt([[3], [2], [6]])
    vertices = np.array([np.zeros(3), *e, e[0] + e[1], e[1] + e[2], e[2] + e[0]]) @ turn.T
    faces = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]]
    mesh = vertices * [1, 1, np.linalg.det(turn)], faces
    pose: Overrides = {"position": (3.0, 0.3, 1.0), "velocity": (-1, 0, 0)}
    actor = rfgen.Actor.from_mesh(mesh, material="pec", name="trihedral", **pose)
    return Setting(None, awr1843(True), (actor,), options={"max_bounces": 3})


def slab() -> Setting:
    """A ball behind a pane of glass of the scene, another one behind a cloth."""
    import sionna.rt

    import rfgen_sionna as rfgen

    folder = tempfile.TemporaryDirectory()
    file = Path(folder.name) / "pane.xml"
    file.write_text(PANE.format(Path(sionna.rt.__file__).parent / "scenes/simple_reflector/meshes/reflector.ply"))
    cloth = replace(rfgen.material("clothing"), thickness=1e-3)
    square = [[1, 0.6, 0.8], [1, 1.0, 0.8], [1, 1.0, 1.2], [1, 0.6, 1.2]], [[0, 1, 2], [0, 2, 3]]
    sheet = rfgen.Actor.from_mesh(square, material=cloth, name="cloth", velocity=(0, 0.5, 0))
    balls = ball("behind glass", (2, 0, 1), velocity=(-1, 0, 0)), ball("behind cloth", (1.5, 1.2, 1))
    return Setting(scene_of(file), awr1843(True), (*balls, sheet), options={"transmission": True}, held=folder)


def cascade() -> Setting:
    """An adult before 12 x 16 elements."""
    import rfgen_sionna as rfgen

    short = {"preset.ti_default.num_loops": 2, "preset.ti_default.num_samples": 128}
    radar = rfgen.Radar.load("mmwcas", overrides=short, **TOWARDS_X)
    return Setting(None, radar, (of_prompt(WALK, radar),), 0.45)


def moving_radar() -> Setting:
    """A radar that travels and turns over a metal plate, and the ghost of a ball in it."""

    def trajectory(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (-1.5 + 0.8 * t, 0.1 * np.sin(3 * t), 0.6), (0.2 * t, 0.3, 0.0)

    balls = (ball("ball", (0.2, 0.0, 0.3)),)
    radar = awr1843(True, trajectory=trajectory)
    return Setting(scene_of("simple_reflector"), radar, balls, 0.1, {"max_bounces": 2})


def position2go() -> Setting:
    """A walking adult at 24 GHz."""
    import rfgen_sionna as rfgen

    radar = rfgen.Radar.load("position2go", **TOWARDS_X)
    return Setting(None, radar, (of_prompt(WALK, radar),), 0.45)


def half_shadow() -> Setting:
    """A ball that comes out behind the edge of a plate."""
    import rfgen_sionna as rfgen

    square = [[1, -0.4, 0.7], [1, 0.05, 0.7], [1, 0.05, 1.3], [1, -0.4, 1.3]], [[0, 1, 2], [0, 2, 3]]
    plate = rfgen.Actor.from_mesh(square, material="wood", name="plate", velocity=(0, -1, 0))
    return Setting(None, awr1843(True), (plate, ball("ball", (2.0, 0.1, 1.0))))


SPEED: dict[str, Speed] = {
    "walk": Speed(walk, "walking adult, free space", 15, most_first=2),
    "room": Speed(lambda: walk(scene="living_room"), "walking adult, living room", 10),
    "hand": Speed(hand, "hand at 0.3 m", 25),
    "breather": Speed(breather, "breather, 2 chirps, 20 frames a second", 10),
    "car": Speed(car, "car at 20 m", 8),
    "dog": Speed(dog, "dog", 8),
    "people": Speed(two_people, "two people", 8),
    "canyon": Speed(
        canyon, "street canyon, pedestrian and car", most_first=40, most_later=0.5, asked_for=True
    ),
    "tiny": Speed(tiny, "coarse ball, short frame", asked_for=True),
}  # fmt: skip
"""Scenes whose frames are timed."""

ERROR: dict[str, Error] = {
    "walk": Error(lambda: walk(True), "walking adult", 2, people=True),
    "jacks": Error(jacks, "jumping jacks", people=True),
    "room": Error(lambda: jacks("living_room"), "jumping jacks in the living room", people=True),
    "ghosts": Error(ghosts, "two balls before a wall and a floor, three bounces"),
    "corner": Error(corner, "trihedral, three bounces"),
    "slab": Error(slab, "balls behind glass and behind cloth"),
    "cascade": Error(cascade, "adult before 12 x 16 elements", people=True),
    "moving_radar": Error(moving_radar, "travelling radar over a plate, two bounces"),
    "hand": Error(lambda: hand(True), "hand at 0.3 m", people=True),
    "car": Error(lambda: car(True), "car at 20 m"),
    "position2go": Error(position2go, "walking adult at 24 GHz", people=True),
    "half_shadow": Error(half_shadow, "ball half behind a moving plate"),
}
"""Scenes whose samples are compared."""

LONG: dict[str, tuple[str | None, float]] = {"free space": (None, 10.0), "living room": ("living_room", 30.0)}
"""Surroundings of 10 s of a walking adult, and most seconds of the wall clock on two cores."""
WORKERS_FACTOR = 1.8
"""Least ratio of the rates of two workers and of one."""


def with_other_diagonals(actor: Any) -> tuple[Any, float]:
    """The same person with quads cut along the other diagonal, and the share of faces that changed.

    Faces 2k and 2k + 1 of a body are one quad. Quads that a cut would fold, or whose diagonal is an edge already, stay.
    """
    sequence = actor.sequence
    faces = np.array(sequence.rig.faces)
    points = np.asarray(sequence.rig.vertices)
    edges = {tuple(sorted(edge)) for a, b, c in faces.tolist() for edge in ((a, b), (b, c), (c, a))}
    changed = 0
    for k in range(0, len(faces) - 1, 2):
        found = _flipped(faces[k], faces[k + 1], points)
        if found is not None and tuple(sorted((int(found[0][0]), int(found[0][1])))) not in edges:
            edges.add(tuple(sorted((int(found[0][0]), int(found[0][1])))))
            faces[k], faces[k + 1] = found
            changed += 2
    other = replace(sequence, rig=replace(sequence.rig, faces=faces))
    return replace(actor, sequence=other), changed / len(faces)


def _flipped(first: NDArray[Any], second: NDArray[Any], points: NDArray[Any]) -> tuple[list[int], list[int]] | None:
    """Two triangles with a common edge as those of the other diagonal, which is the first edge of the first one."""
    apart, beyond = set(first.tolist()) - set(second.tolist()), set(second.tolist()) - set(first.tolist())
    if len(apart) != 1 or len(beyond) != 1:
        return None
    (b,), (d,) = apart, beyond
    at = first.tolist().index(b)
    c, a = int(first[(at + 1) % 3]), int(first[(at + 2) % 3])

    def normal(*corners: int) -> NDArray[Any]:
        p, q, r = points[list(corners)]
        return np.asarray(np.cross(q - p, r - p))

    whole = normal(a, b, c) + normal(c, d, a)
    if min(normal(b, d, a) @ whole, normal(d, b, c) @ whole) <= 0:
        return None
    return [b, d, a], [d, b, c]
