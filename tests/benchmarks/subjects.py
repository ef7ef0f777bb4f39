"""The scenes of the benchmark: what stands before the radar, and what it truly returns.

All move away from the radar in half millimetres, and nothing but translates: a method's error is in what it makes of
that. One isotropic element sends and receives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene import MeshActor, RadarScene, RigidMesh, load_scene
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.surface.smoothing import find_smoothing
from tests.benchmarks import truth
from tests.benchmarks.truth import Quadrature

SPEED = 0.5
"""Of all subjects [m/s]: half a millimetre in a millisecond."""
PERMITTIVITY = {"pec": complex(np.inf)}


@dataclass(frozen=True)
class Subject:
    """One scene."""

    name: str
    title: str
    radar: Radar
    actors: tuple[MeshActor, ...]
    truth: str
    """Where what it truly returns comes from."""
    half_view: float
    """Tangent of half the angle that the subject fills, with a margin; the radar looks at its middle."""
    scene: RadarScene | None = None
    free_phase: bool = False
    """Whether a constant phase of `expected` is open."""
    max_bounces: int = 1
    least_bounces: int = 1
    """Paths with fewer don't count: what is expected holds for the others."""
    expected: Callable[[FloatArray, float], ComplexArray] | None = None
    """Times (step,) [s] and a frequency [Hz] to the channel of a point-like return; None where `quadrature` tells."""
    quadrature: Callable[[bool, float], Quadrature] | None = None
    """Of the smooth surface or of the mesh as it is, a polyhedron: what methods are held against that see nothing else;
    with the density of the points."""
    hides: tuple[tuple[FloatArray, IntArray], ...] = ()
    """Vertices [m] and faces of what else stands there."""
    towards: FloatArray = field(default_factory=lambda: np.array([1.0, 0, 0]))
    """(3,) unit vector that it moves along."""
    path: Callable[[FloatArray], FloatArray] = lambda t: t
    """Of point-like returns: times (step,) [s] to half the path [m]."""

    @property
    def frequency(self) -> float:
        return self.radar.center_frequency

    @property
    def permittivity(self) -> complex:
        return permittivity(self.actors[0], self.frequency)

    def counted(self, paths: RadarPaths) -> Any:
        return np.flatnonzero(paths.bounces >= self.least_bounces)


def permittivity(actor: MeshActor, frequency: float) -> complex:
    return complex(actor.properties.relative_permittivity(frequency))


def radar_of(band: int, **waveform: Any) -> Radar:
    """One isotropic element at the origin that looks along +x, in the 24 or the 77 GHz band."""
    name, preset = {24: ("position2go", None), 77: ("awr1843", "mmmesh")}[band]
    radar = replace(Radar.load(name, preset), pattern=ElementPattern(0.0))
    here = np.zeros((1, 3))
    return replace(
        radar,
        waveform=replace(radar.waveform, tx_order=(0,), **waveform),
        tx_power_dbm=30.0, tx_positions=here, tx_names=radar.tx_names[:1], rx_positions=here,
        rx_names=radar.rx_names[:1],
    )  # fmt: skip


def ball(subdivisions: int, radius: float) -> trimesh.Trimesh:
    """An icosphere, turned so that no axis of its points at the radar."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    mesh.apply_transform(trimesh.transformations.euler_matrix(0.3, 0.5, 0.7))
    return mesh


def sphere(band: int, subdivisions: int = 5) -> Subject:
    radius, distance = 0.15, 3.0
    radar = radar_of(band)
    actor = MeshActor.from_mesh(
        ball(subdivisions, radius), material="pec", position=(distance, 0, 0), velocity=(SPEED, 0, 0), name="ball"
    )

    def at(t: FloatArray, frequency: float) -> ComplexArray:
        return truth.sphere_gain(radius, distance + SPEED * t, frequency)

    return Subject(
        "sphere", f"metal sphere of {100 * radius:g} cm at {distance:g} m", radar, (actor,),
        "Mie series (miepython), near-field divergence R (R - a)",
        1.1 * radius / (distance - radius), free_phase=True, expected=at,
        path=lambda t: distance - radius + SPEED * t,
    )  # fmt: skip


def plate(band: int) -> Subject:
    """A metal plate that is tilted by one degree: its first side lobe at 77 GHz."""
    mesh = trimesh.Trimesh([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0.1, 0.1], [0, -0.1, 0.1]], [[0, 2, 1], [0, 3, 2]])
    return _body("plate", "metal plate of 20 cm at 3 m, tilted by 1°", band, mesh, "pec", (3, 0, 0), (0.0175, 0, 0))


def dihedral(band: int) -> Subject:
    a, distance = 0.1, 100.0
    section = 8 * np.pi * a**4 * (radar_of(band).center_frequency / 299_792_458.0) ** 2
    # Two squares that meet in the z axis and open towards -x.
    r = a / np.sqrt(2)
    points = [[0, 0, -a / 2], [0, 0, a / 2], [-r, r, -a / 2], [-r, r, a / 2], [-r, -r, -a / 2], [-r, -r, a / 2]]
    mesh = trimesh.Trimesh(points, [[0, 1, 3], [0, 3, 2], [1, 0, 4], [1, 4, 5]], process=False)
    return _corner("dihedral", f"dihedral of {100 * a:g} cm at {distance:g} m", band, mesh, section, distance, 2)


def trihedral(band: int) -> Subject:
    a, distance = 0.1, 100.0
    section = 12 * np.pi * a**4 * (radar_of(band).center_frequency / 299_792_458.0) ** 2
    faces = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]]
    points = a * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], float)
    mesh = trimesh.Trimesh(points, faces, process=False)
    diagonal = np.ones(3) / np.sqrt(3)
    across = np.array([1, -1, 0]) / np.sqrt(2)
    mesh.vertices = mesh.vertices @ -np.stack([diagonal, across, np.cross(diagonal, across)]).T
    return _corner("trihedral", f"trihedral of {100 * a:g} cm at {distance:g} m", band, mesh, section, distance, 3)


def _corner(
    name: str, title: str, band: int, mesh: trimesh.Trimesh, section: float, distance: float, bounces: int
) -> Subject:
    radar = radar_of(band, slope={24: 0.25e12, 77: 4e12}[band])  # 128 and 165 m of range
    actor = MeshActor.from_mesh(mesh, material="pec", position=(distance, 0, 0), velocity=(SPEED, 0, 0), name=name)

    centre = radar.center_frequency

    def at(t: FloatArray, frequency: float) -> ComplexArray:
        return truth.section_gain(section * (frequency / centre) ** 2, distance + SPEED * t, frequency)

    return Subject(
        name, title, radar, (actor,), "closed form of geometrical optics, far field",
        0.12 / distance, free_phase=True, max_bounces=bounces, least_bounces=bounces, expected=at,
        path=lambda t: distance + SPEED * t,
    )  # fmt: skip


@cache
def standing() -> RigidMesh:
    """An adult who stands still, facing +x."""
    from rfgen_sionna.generative.actor import Actor as Person

    body = Person.from_prompt("a person standing", seed=0, duration=1.0)
    return RigidMesh(body.sequence.vertices(0.0), body.faces, "person")


@cache
def hand_mesh() -> RigidMesh:
    """The hand of a grown-up who reaches it out, palm ahead; the wrist is open."""
    from rfgen_sionna.generative.actor import Actor as Person

    body = Person.from_prompt("a person pushing with the right hand", seed=0, duration=3.0)
    part = body.part_names.index("right_hand")
    faces = body.faces[body.face_parts == part]
    used, index = np.unique(faces, return_inverse=True)
    middles = [body.sequence.vertices(t)[used].mean(axis=0) for t in np.linspace(0, 3, 31)]
    t = 0.1 * int(np.argmax([middle[0] for middle in middles]))
    points = body.sequence.vertices(t)[used]
    return RigidMesh(points - points.mean(axis=0), index.reshape(faces.shape), "hand")


def person(band: int) -> Subject:
    mesh = standing()
    return _body("person", "adult of skin at 3 m, 27,420 facets", band, mesh, "skin", (3, 0, -0.9), (np.pi, 0, 0))


def person_in_room(band: int) -> Subject:
    mesh, scene = standing(), load_scene("living_room")
    found = _body(
        "living_room", "adult of skin in the living room", band, mesh, "skin", (3, 0, 0), (np.pi, 0, 0), 1.0, scene
    )
    return found


def car(band: int) -> Subject:
    import sionna.rt

    mesh = trimesh.load(Path(sionna.rt.__file__).parent / "scenes" / "low_poly_car.ply", force="mesh", process=False)
    mesh.invert()
    name = "car of 4.4 m at 8 m, of metal, its front turned by 30°"
    return _body("car", name, band, mesh, "pec", (8, 0, -0.8), (np.radians(150), 0, 0))


def hand(band: int) -> Subject:
    return _body("hand", "hand of skin at 0.3 m", band, hand_mesh(), "skin", (0.3, 0, 0), (np.pi, 0, 0))


def _body(
    name: str, title: str, band: int, mesh: Any, material: str, place: tuple[float, float, float],
    orientation: tuple[float, float, float], height: float = 0.0, scene: RadarScene | None = None,
) -> Subject:  # fmt: skip
    """A mesh whose truth is dense quadrature; hidden points are found one by one."""
    radar = radar_of(band)
    if scene is not None:
        radar = radar.placed(position=(0, 0, height))
        scene.tune(radar.center_frequency)
    viewpoint, towards = np.asarray(radar.position), np.zeros(3)
    shape = mesh.vertices(0.0) if isinstance(mesh, RigidMesh) else np.asarray(mesh.vertices)
    actor = MeshActor.from_mesh((shape, mesh.faces),
                            material=material, position=place, orientation=orientation, name=name)  # fmt: skip
    points = actor.vertices(0.0)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radar = radar.placed(position=radar.position, look_at=tuple(middle))
    towards = (middle - viewpoint) / np.linalg.norm(middle - viewpoint)
    actor = replace(actor, velocity=tuple(SPEED * towards))
    local = (points - viewpoint) @ radar.rotation
    half = 1.05 * float(np.abs(local[:, 1:] / local[:, :1]).max())

    static = () if scene is None else tuple((each.vertices, each.faces) for each in scene.objects)
    curved = find_smoothing(points, actor.faces) is not None

    @cache
    def rays() -> RayScene:
        return RayScene(static, [(points, actor.faces)], origin=viewpoint)

    def quadrature(smooth: bool, oversampling: float) -> Quadrature:
        return Quadrature(
            points, actor.faces, viewpoint, radar.center_frequency, permittivity(actor, radar.center_frequency),
            radar.tx_field, rays, sum(len(faces) for _, faces in static), oversampling, smooth and curved,
        )  # fmt: skip

    return Subject(
        name, title, radar, (actor,), "dense quadrature of physical optics, visibility point by point", half, scene,
        quadrature=quadrature, hides=static, towards=towards,
    )  # fmt: skip


SUBJECTS: dict[str, Callable[[int], Subject]] = {
    "sphere": sphere, "plate": plate, "dihedral": dihedral, "trihedral": trihedral, "person": person,
    "living_room": person_in_room, "car": car, "hand": hand,
}  # fmt: skip
BANDS = {name: (77,) if name == "living_room" else (24, 77) for name in SUBJECTS}
