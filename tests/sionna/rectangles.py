"""Sionna scenes of rectangles and other meshes, and a radar with its two ends apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import load_scene
from rfgen_sionna.scene.radio_materials import sionna_material


def scene_of(frequency, **rectangles):
    """A scene with `name=(corners (4, 3) [m], material)` or `name=(corners, material, thickness [m])`."""
    scene = load_scene(None)
    scene.tune(frequency)
    add_rectangles(scene, **rectangles)
    return scene


def add_rectangles(scene, **rectangles):
    faces = [[0, 1, 2], [0, 2, 3]]
    add_meshes(scene, **{name: ((corners, faces), *rest) for name, (corners, *rest) in rectangles.items()})


def add_meshes(scene, **meshes):
    """Add `name=((vertices (n, 3) [m], faces (m, 3)), material)` or `name=(mesh, material, thickness [m])`."""
    import mitsuba as mi
    import sionna.rt as rt

    added = []
    for name, ((vertices, faces), material, *thickness) in meshes.items():
        mesh = mi.Mesh(name, len(vertices), len(faces))
        parameters = mi.traverse(mesh)
        parameters["faces"] = mi.UInt32(np.asarray(faces, np.uint32).ravel())
        parameters["vertex_positions"] = mi.Float(np.asarray(vertices, np.float32).ravel())
        parameters.update()
        surface = sionna_material(material, name=f"{name}-material", thickness=thickness[0] if thickness else None)
        added.append(rt.SceneObject(mi_mesh=mesh, name=name, radio_material=surface))
    scene.sionna.edit(add=added)


def wall(x, half=3.0, y=0.0, z=1.0):
    """Corners of a square across the x axis."""
    return [[x, y - half, z - half], [x, y + half, z - half], [x, y + half, z + half], [x, y - half, z + half]]


def apart(axis=1, baseline=0.1, **pose):
    """An AWR1843's waveform on two Tx elements and one Rx element, `baseline` [m] from each other along an axis."""
    radar = Radar.load("awr1843", **pose)
    half = 0.5 * baseline * np.eye(3)[axis]
    return replace(
        radar,
        tx_positions=half + np.array([[0, 0, 0], [0, 0.002, 0.001]]),
        tx_names=("A", "B"),
        rx_positions=-half[None],
        rx_names=("R",),
        waveform=replace(radar.waveform, tx_order=(0, 1)),
    )
