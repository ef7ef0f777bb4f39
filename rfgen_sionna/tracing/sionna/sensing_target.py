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
"""Half the stretch over which the velocity is differenced [s]."""
MAX_PHASE_ERROR = 0.3
"""Phase [rad] by which a piece's corners depart from its far field at the given distance; a third of it on the mean.

A third of it would need as many points again and more, and a person 3 m away asks for about `MAX_PIECES` as it is."""
MAX_SAGITTA = 0.25
"""Phase [rad] by which a round surface may rise over an edge of a facet, there and back."""
SHADOW_STEPS = 32
"""Facets are no longer than this part of the actor's size: its own shadows end between three points of a facet."""
MAX_PIECES = 2048
"""Sionna compiles one callable per scattering point, some 30 ms each."""


def add_actor(
    scene: RadarScene | Any, actor: MeshActor, t: float = 0.0, *, distance: float | None = None, name: str | None = None
) -> Any:
    """Put an actor, as it stands at an instant, into a Sionna scene as a `sionna.rt.rcs.SensingTarget`.

    `sionna.rt.rcs.RCSSolver` then finds the paths by way of it, with the physical-optics cross-section, phase and
    polarisation of its mesh for every pair of directions, computed as the solver asks: self-shadowing, Fresnel
    coefficients of its material at the scene's frequency, bistatic directions and ghosts in walls included. To other
    paths it is an absorber, as all of Sionna's targets are.

    Sionna knows scattering points, which see plane waves. One of them stands for the whole actor at ranges beyond
    2 D^2 / lambda, which for a person at 77 GHz is more than a kilometre; for nearer devices give `distance`, and the
    actor becomes as many points as its near field asks for. At that distance their phases err by 0.1 rad in common,
    and the field of a flat face by 2 % of what it returns broadside: less than 0.1 dB in its main lobe, a dB or so in
    its side lobes, which are 17 dB and more below. Sionna reserves memory for a million legs per point: with hundreds
    of points call the solver with a `buffer_size_per_sp` of hundreds, too. Sionna moves a target by one velocity: the
    mean of the actor's surface at `t`. The target may be moved and turned about the vertical in Sionna; add the actor
    anew for another pose (Sionna does not turn the polarisation with a target that is tilted, and scales no
    cross-section).

    Parameters
    ----------
    scene
        A scene of :func:`rfgen_sionna.scene.load_scene`, or a `sionna.rt.Scene`.
    t
        Instant of the pose [s].
    distance
        Of the nearest transmitter or receiver [m]; None makes it a single point.
    name
        Name of the target in the scene; the actor's own if None.

    Raises
    ------
    TypeError
        If the scene, the actor or the name is none.
    ValueError
        If the scene has something of that name, the instant is not finite, the distance is not positive, or the actor
        would need more than `MAX_PIECES` points.
    """
    inside = sionna_scene(scene)
    if not isinstance(actor, MeshActor):
        raise TypeError(f"actor: {type(actor).__name__} given, an rfgen_sionna.Actor is needed")
    if not is_number(t):
        raise ValueError(f"t is {t!r}: a finite instant [s] is needed")
    if distance is not None and not (is_number(distance) and distance > 0):
        raise ValueError(f"distance is {distance!r}: a positive value [m] or None is needed")
    if name is not None and not isinstance(name, str):
        raise TypeError(f"name: {type(name).__name__} given, a text or None is needed")
    import mitsuba
    from sionna.rt.rcs import ScatteringModel, SensingTarget

    from rfgen_sionna.scene.ray_layer import MeshLayer
    from rfgen_sionna.tracing.sionna.far_field import ScatteringMesh, ScatteringPoint

    mi: Any = mitsuba
    name = actor.name if name is None else name
    for known in (inside.objects, inside.transmitters, inside.receivers, inside.radio_materials):
        if name in known:
            raise ValueError(f"name is {name!r}: the scene has something of that name already; choose another one")

    def frequency() -> float:
        return float(inside.frequency[0])

    vertices, faces = actor.vertices(t), actor.faces
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    mesh = MeshLayer([(vertices, faces)], np.zeros(3), moving=False).scene.shapes()[0]
    finest = float(np.ptp(vertices, axis=0).max()) / SHADOW_STEPS
    if distance is None:
        local, faces = _subdivide(vertices - centre, faces, finest, frequency())
        pieces = np.zeros(len(faces), dtype=np.int32)
    else:
        edge = float(np.sqrt(2 * MAX_PHASE_ERROR * distance * SPEED_OF_LIGHT / (2 * np.pi * frequency())))
        local, faces = _subdivide(vertices - centre, faces, min(finest, edge), frequency())
        cells = np.floor(local[faces].mean(axis=1) / edge).astype(np.int64)
        cell = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.argsort(cell, kind="stable")
        faces, pieces = faces[order], cell[order].astype(np.int32)
        if pieces[-1] >= MAX_PIECES:
            raise ValueError(
                f"{actor.name}: distance {distance:g} m at {frequency() / 1e9:.4g} GHz asks for {pieces[-1] + 1} "
                f"scattering points of {100 * edge:.1f} cm, {MAX_PIECES} are allowed: give a longer distance, or take "
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
    """(piece, 3) area-weighted centroids of the surface's pieces."""
    weight = np.linalg.norm(face_normals(vertices, faces), axis=1)
    pieces = np.zeros(len(faces), dtype=np.int32) if pieces is None else pieces
    middles = vertices[faces].mean(axis=1) * weight[:, None]
    sums = np.stack([np.bincount(pieces, weights=column) for column in middles.T], axis=1)
    return np.asarray(sums / np.bincount(pieces, weights=weight)[:, None])


def _subdivide(vertices: FloatArray, faces: IntArray, edge: float, frequency: float) -> tuple[FloatArray, IntArray]:
    """The mesh with no edge longer than `edge` [m], and on the smooth surface that it samples, if it does."""
    smooth = find_smoothing(vertices, faces)
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
        # As high as the patch is on the mean: a third of what its edges rise.
        done.append(corners[~coarse] + corner_offsets + last.sagittas.mean(axis=1, keepdims=True))
        corners, patch = split_values(QUARTERS, corners[coarse]), patch.take(np.flatnonzero(coarse)).divided(QUARTERS)
    found = np.concatenate(done)
    return found.reshape(-1, 3), np.arange(3 * len(found), dtype=np.int32).reshape(-1, 3)
