"""Furnished places as scenes of Sionna."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.scene import StaticObject


def to_sionna(objects: Sequence[StaticObject], colours: FloatArray, frequency: float) -> Any:
    """A `sionna.rt.Scene` of some objects, at a carrier frequency [Hz].

    Raises:
        BackendError: Mitsuba cannot run here.
    """
    from rfgen_sionna.scene.mitsuba_backend import ensure_backend

    ensure_backend()
    import mitsuba as mi
    import sionna.rt

    from rfgen_sionna.scene.radio_materials import sionna_material

    scene = sionna.rt.load_scene()
    materials: dict[Any, Any] = {}
    found = []
    for item, colour in zip(objects, colours, strict=True):
        key = (item.properties.name, item.properties.thickness, item.properties.scattering_coefficient, tuple(colour))
        if key not in materials:
            materials[key] = sionna_material(item.properties, name=f"{item.properties.name} {len(materials)}")
            materials[key].color = tuple(float(c) for c in colour)
        mesh = mi.Mesh(item.name, len(item.vertices), len(item.faces))
        parameters = mi.traverse(mesh)
        parameters["faces"] = mi.UInt32(np.ascontiguousarray(item.faces.ravel(), dtype=np.uint32))
        key_of_points = next(k for k in parameters.keys() if k.startswith("vertex_position"))  # noqa: SIM118
        parameters[key_of_points] = mi.Float(np.ascontiguousarray(item.vertices.ravel(), dtype=np.float32))
        parameters.update()
        found.append(sionna.rt.SceneObject(mi_mesh=mesh, name=item.name, radio_material=materials[key]))
    scene.edit(add=found)
    scene.frequency = frequency
    return scene
