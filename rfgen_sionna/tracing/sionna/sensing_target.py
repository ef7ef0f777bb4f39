"""Actors as sensing targets of Sionna."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.devices import sionna_scene
from rfgen_sionna.scene.mesh import face_normals, lengths
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.tracing.surface.quadratic_patch import QUARTERS, split_values
from rfgen_sionna.tracing.surface.smoothing import find_smoothing

RATE_STEP = 0.5e-3
"""Half step of the velocity's central difference [s]."""
MAX_PHASE_ERROR = 0.3
"""Phase error of a piece's far-field approximation at its corners [rad]; a third of it in the mean."""
MAX_SAGITTA = 0.25
"""Two-way phase of a facet's sagitta [rad]."""
SHADOW_STEPS = 32
"""Largest facets over the actor's size; self-shadowing is resolved to a third of a facet."""
MAX_PIECES = 2048
"""Most scattering points; Sionna compiles each in some 30 ms."""


def add_actor(
    scene: RadarScene | Any, actor: MeshActor, t: float = 0.0, *, distance: float | None = None, name: str | None = None
) -> Any:
    """Add an actor's pose at `t` to a Sionna scene as a `sionna.rt.rcs.SensingTarget`.

    `sionna.rt.rcs.RCSSolver` then finds its paths, with the bistatic physical-optics cross-section, phase and
    polarisation of the mesh, self-shadowing and the Fresnel coefficients of its material included. Other paths are
    absorbed, as by all of Sionna's targets.

    A scattering point sees plane waves, so one point is valid beyond 2 D^2 / lambda. `distance` splits the actor into
    points with valid far fields from there on. With hundreds of points set the solver's `buffer_size_per_sp` to
    hundreds as well. The target moves with the surface's mean velocity at `t`. Move it or turn it about the vertical
    only; add the actor anew for another pose.

    Parameters
    ----------
    scene
        A scene of :func:`rfgen_sionna.scene.load_scene` or a `sionna.rt.Scene`.
    actor
        The actor.
    t
        Time of the pose [s].
    distance
        Distance of the nearest transmitter or receiver [m]; None makes one point.
    name
        Name of the target in the scene; None uses the actor's.

    Raises
    ------
    TypeError
        If the scene, the actor or the name has another type.
    ValueError
        If the name is taken, the time is not finite, the distance is not positive, or more than `MAX_PIECES` points are
        needed.
    """
    inside = sionna_scene(scene)
    if not isinstance(actor, MeshActor):
        raise TypeError(f"actor is a {type(actor).__name__}: give an rfgen_sionna.Actor")
    if not is_number(t):
        raise ValueError(f"t is {t!r}: give a finite time [s]")
    if distance is not None and not (is_number(distance) and distance > 0):
        raise ValueError(f"distance is {distance!r}: give a positive value [m] or None")
    if name is not None and not isinstance(name, str):
        raise TypeError(f"name is a {type(name).__name__}: give a text or None")
    import mitsuba
    from sionna.rt.rcs import ScatteringModel, SensingTarget

    from rfgen_sionna.scene.ray_layer import MeshLayer
    from rfgen_sionna.tracing.sionna.far_field import ScatteringMesh, ScatteringPoint

    mi: Any = mitsuba
    name = actor.name if name is None else name
    for known in (inside.objects, inside.transmitters, inside.receivers, inside.radio_materials):
        if name in known:
            raise ValueError(f"name is {name!r}: the scene has an object of that name; choose another name")

    def frequency() -> float:
        return float(inside.frequency[0])

    vertices, faces = actor.vertices(t), actor.faces
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    mesh = MeshLayer([(vertices, faces)], np.zeros(3), moving=False).scene.shapes()[0]
    finest = float(np.ptp(vertices, axis=0).max()) / SHADOW_STEPS
    if distance is None:
        local, faces = subdivide(vertices - centre, actor.rest_vertices, faces, finest, frequency())
        pieces = np.zeros(len(faces), dtype=np.int32)
    else:
        edge = float(np.sqrt(2 * MAX_PHASE_ERROR * distance * SPEED_OF_LIGHT / (2 * np.pi * frequency())))
        local, faces = subdivide(vertices - centre, actor.rest_vertices, faces, min(finest, edge), frequency())
        cells = np.floor(local[faces].mean(axis=1) / edge).astype(np.int64)
        cell = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.argsort(cell, kind="stable")
        faces, pieces = faces[order], cell[order].astype(np.int32)
        if pieces[-1] >= MAX_PIECES:
            raise ValueError(
                f"{actor.name}: distance {distance:g} m at {frequency() / 1e9:.4g} GHz needs {pieces[-1] + 1} "
                f"scattering points of {100 * edge:.1f} cm, {MAX_PIECES} are allowed: give a longer distance, or use "
                "rfgen's own tracer"
            )
    places = _centroids(local, faces, pieces)
    body = ScatteringMesh(local, faces, pieces, actor.properties, frequency)
    points = [ScatteringPoint(body, number, place) for number, place in enumerate(places)]
    model = ScatteringModel(
        mi.Point3f(*(mi.Float(column) for column in places.T.astype(np.float32).copy())),
        rcs=[point.rcs for point in points],
        cpm=[point.cpm for point in points],
    )
    before, after = (_centroids(actor.vertices(t + step), actor.faces)[0] for step in (-RATE_STEP, RATE_STEP))
    target = SensingTarget(
        name=name,
        scattering_model=model,
        mi_mesh=mesh,
        velocity=mi.Vector3f(*((after - before) / (2 * RATE_STEP)).tolist()),
    )
    inside.add(target)
    return target


def _centroids(vertices: FloatArray, faces: IntArray, pieces: IntArray | None = None) -> FloatArray:
    """(piece, 3) area-weighted centroids of the surface's pieces [m]."""
    weight = np.linalg.norm(face_normals(vertices, faces), axis=1)
    pieces = np.zeros(len(faces), dtype=np.int32) if pieces is None else pieces
    middles = vertices[faces].mean(axis=1) * weight[:, None]
    sums = np.stack([np.bincount(pieces, weights=column) for column in middles.T], axis=1)
    return np.asarray(sums / np.bincount(pieces, weights=weight)[:, None])


def subdivide(
    vertices: FloatArray, rest: FloatArray, faces: IntArray, edge: float, frequency: float
) -> tuple[FloatArray, IntArray]:
    """Subdivide the mesh, on its smooth surface if it has one, to edges no longer than `edge` [m]; its positions at
    `rest` (vertex, 3) [m] tell where it is smooth."""
    smooth = find_smoothing(rest, faces)
    if smooth is None:
        import trimesh

        vertices, faces = trimesh.remesh.subdivide_to_size(vertices, faces, edge, max_iter=40)
        return np.asarray(vertices, np.float64), np.asarray(faces, np.int32)
    corners, patch, done = vertices[faces], smooth.patch(vertices, faces), []
    while len(corners):
        rise = lengths(patch.sagittas).max(axis=1) * 4 * np.pi * frequency / SPEED_OF_LIGHT
        coarse = (rise > MAX_SAGITTA) | (lengths(corners[:, [1, 2, 0]] - corners).max(axis=1) > edge)
        last = patch.take(np.flatnonzero(~coarse))
        corner_offsets = 0.0 if last.corner_offsets is None else last.corner_offsets
        # Mean height of the patch.
        done.append(corners[~coarse] + corner_offsets + last.sagittas.mean(axis=1, keepdims=True))
        corners, patch = split_values(QUARTERS, corners[coarse]), patch.take(np.flatnonzero(coarse)).divided(QUARTERS)
    found = np.concatenate(done)
    return found.reshape(-1, 3), np.arange(3 * len(found), dtype=np.int32).reshape(-1, 3)
