"""Scenes of arrays: mesh files and furnished places, with a Sionna scene on demand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.material_names import label_parts
from rfgen_sionna.scene.materials import Material, material, warn_uncovered
from rfgen_sionna.scene.mesh import check_soup
from rfgen_sionna.scene.mesh_files import read_mesh_parts, warn_of_scene_units
from rfgen_sionna.scene.permittivity import Outside
from rfgen_sionna.scene.scene import RadarScene, StaticObject

_FREQUENCY = 77e9
"""Frequency [Hz] of a Sionna scene that is made before the scene has one."""


class ArrayScene(RadarScene):
    """A :class:`~rfgen_sionna.scene.RadarScene` of arrays in double precision. The first access to `sionna` makes its
    Sionna scene, which the tracer does not need."""

    surface_frequency: float = _FREQUENCY

    @property
    def is_free_space(self) -> bool:
        return False

    @property
    def colours(self) -> FloatArray:
        """(object, 3) red, green, blue of each object, 0 … 1."""
        return np.full((len(self.objects), 3), 0.6)

    def tune(self, frequency: float) -> None:
        if not (np.isfinite(frequency) and frequency > 0.0):
            raise ValueError(f"frequency: {frequency!r} given, a positive value [Hz] is needed")
        if frequency == self.frequency:
            return
        for item in self.objects:
            if self.outside == "raise":
                item.properties.check(frequency, item.name)
        if "sionna" in self.__dict__:
            self.sionna.frequency = frequency
        self.frequency = float(frequency)
        warn_uncovered([item.properties for item in self.objects], frequency, stacklevel=2)

    @cached_property
    def sionna(self) -> Any:
        """The scene as a `sionna.rt.Scene`, in single precision."""
        return _to_sionna(self.objects, self.colours, self.frequency or self.surface_frequency)


class MeshScene(ArrayScene):
    """Scene of a mesh file, with an object for each object and material of the file.

    Args:
        path: OBJ, glTF, PLY, STL or OFF file; colours and textures have no effect.
        materials: materials by names of materials or objects in the file; others must be names of materials.
        default_material: material of all other parts; None refuses them.
        up, scale: up axis, and metres per unit, as of :func:`~rfgen_sionna.scene.mesh_files.read_mesh_parts`.
        frequency, outside: as of :func:`~rfgen_sionna.scene.load.load_scene`.

    Raises:
        MeshError: the file cannot be read, or has no triangles.
        MaterialError: parts have no known material.
        ValueError: `up` is no axis, `scale` is not positive.
    """

    def __init__(
        self,
        path: Path,
        *,
        materials: Mapping[str, str | Material] | None = None,
        default_material: str | Material | None = None,
        up: str | None = None,
        scale: float | None = None,
        frequency: float | None = None,
        outside: Outside = "extrapolate",
    ) -> None:
        super().__init__(path.stem, path, outside=outside)
        parts = read_mesh_parts(path, up=up, scale=scale, front=False)
        words = {"argument": "materials", "one": "default_material", "call": "load_scene "}
        labels, chosen = label_parts(parts, materials or {}, self.name, default_material, **words)
        found = {
            label: of if isinstance(of, Material) else material(of, outside=outside, owner=f"{self.name}: {label}")
            for label, of in chosen.items()
        }
        names, objects = Counter[str](), list[StaticObject]()
        for part, label in zip(parts, labels, strict=True):
            name = ", ".join(dict.fromkeys(each for each in (part.name, part.material) if each)) or self.name
            names[name] += 1
            name = name if names[name] == 1 else f"{name} {names[name]}"
            objects.append(StaticObject(name, found[label], *check_soup(part.vertices, part.faces, name)))
        warn_of_scene_units(self.name, [item.vertices for item in objects], stacklevel=4)
        self.__dict__["objects"] = tuple(objects)  # of the cached property
        if frequency is not None:
            self.tune(frequency)


def _to_sionna(objects: Sequence[StaticObject], colours: FloatArray, frequency: float) -> Any:
    """A `sionna.rt.Scene` of objects with colours (object, 3) at a carrier frequency [Hz]."""
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
        name = item.name.replace(".", "_")  # Mitsuba separates the parts of names by dots
        mesh = mi.Mesh(name, len(item.vertices), len(item.faces))
        parameters = mi.traverse(mesh)
        parameters["faces"] = mi.UInt32(np.ascontiguousarray(item.faces.ravel(), dtype=np.uint32))
        key_of_points = next(k for k in parameters.keys() if k.startswith("vertex_position"))  # noqa: SIM118
        parameters[key_of_points] = mi.Float(np.ascontiguousarray(item.vertices.ravel(), dtype=np.float32))
        parameters.update()
        found.append(sionna.rt.SceneObject(mi_mesh=mesh, name=name, radio_material=materials[key]))
    scene.edit(add=found)
    scene.frequency = frequency
    return scene
