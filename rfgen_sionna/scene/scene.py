"""Static surroundings: a Sionna scene at radar frequencies, its meshes as arrays, the free space of a room."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material, warn_uncovered
from rfgen_sionna.scene.mesh import face_normals, used_vertices
from rfgen_sionna.scene.mitsuba_file import bare_name, exact_mesh, scene_tree, shapes_by_name
from rfgen_sionna.scene.permittivity import Outside
from rfgen_sionna.scene.scene_errors import MaterialError, SceneError

_DESCRIPTION = (
    "allowed are tables [[interior]] with low = [x, y, z] and high = [x, y, z], low below high, a table [materials], "
    "default_material, up and scale"
)
"""Contents of the TOML file beside a scene file."""


@dataclass(frozen=True)
class Interior:
    """Free space of a room: a union of boxes with low and high corners (box, 3) [m]."""

    low: FloatArray
    high: FloatArray

    def contains(self, point: ArrayLike) -> bool:
        """Whether a point (3,) [m] lies in one of the boxes."""
        place = np.asarray(point, np.float64)
        return bool(((place >= self.low) & (place <= self.high)).all(axis=1).any())

    def __str__(self) -> str:
        return " or ".join(
            ", ".join(f"{axis} {a:g} … {b:g}" for axis, a, b in zip("xyz", low, high, strict=True))
            for low, high in zip(self.low.tolist(), self.high.tolist(), strict=True)
        )


def read_interior(path: Path) -> Interior | None:
    """Interior of a scene from a TOML file of tables `[[interior]]` with `low` and `high` corners [m]; None without.

    Raises
    ------
    SceneError
        The tables have anything else, or a box without volume.
    """
    boxes = read_description(path).get("interior")
    if boxes is None:
        return None
    try:
        if any(set(box) != {"low", "high"} for box in boxes):
            raise ValueError(f"interior has {', '.join(dict.fromkeys(key for box in boxes for key in box))}")
        low, high = (np.array([box[end] for box in boxes], np.float64) for end in ("low", "high"))
        if low.shape[1:] != (3,) or high.shape != low.shape or not (low < high).all():
            raise ValueError(f"low is {low.tolist()} and high {high.tolist()}")
    except (ValueError, TypeError) as error:
        raise SceneError(f"scene description {path.name!r}: {error}; {_DESCRIPTION}") from error
    return Interior(low, high)


def read_description(path: Path) -> dict[str, Any]:
    """Contents of the TOML file beside a scene file: `interior`, and arguments of
    :func:`~rfgen_sionna.scene.load.load_scene`; empty if there is no file.

    Raises
    ------
    SceneError
        The file is no TOML, or has other keys.
    """
    if not path.is_file():
        return {}
    try:
        held = tomllib.loads(path.read_text(encoding="utf-8"))
        if other := [key for key in held if key not in ("interior", "materials", "default_material", "up", "scale")]:
            raise ValueError(f"it has {', '.join(other)}")
    except ValueError as error:  # errors of TOML and Unicode are ValueErrors
        raise SceneError(f"scene description {path.name!r}: {error}; {_DESCRIPTION}") from error
    return held


@dataclass(frozen=True, eq=False, repr=False)
class StaticObject(ShortRepr):
    """A static mesh of the scene, with two-sided surfaces as in Sionna."""

    name: str
    properties: Material
    """Material with its thickness and scattering coefficient in this scene."""
    vertices: FloatArray
    """(vertex, 3) world positions of the used vertices [m]."""
    faces: IntArray
    """(face, 3) vertex indices of the faces with an area."""

    @property
    def material(self) -> str:
        """Name of the material."""
        return self.properties.name


class RadarScene:
    """Static surroundings of :func:`~rfgen_sionna.scene.load.load_scene`: a Sionna scene, and its meshes as arrays.

    Mitsuba starts with the first access to `objects` or `sionna`.
    """

    def __init__(
        self,
        name: str,
        path: Path | None = None,
        scene: Any = None,
        frequency: float | None = None,
        outside: Outside = "extrapolate",
        materials: Mapping[str, Material] = MappingProxyType({}),
    ) -> None:
        self.name = name
        self.path = path
        self.frequency = frequency
        """Carrier frequency of the Sionna scene [Hz]; None leaves its own."""
        self.outside: Outside = outside
        self._materials = materials
        self._given = scene
        self._shapes: Mapping[str, ElementTree.Element] = {}
        self._unfollowed: tuple[tuple[str, ...], tuple[str, ...]] = (), ()

    def __repr__(self) -> str:
        return f"RadarScene({self.name!r})"

    @property
    def is_free_space(self) -> bool:
        """Whether there are no surroundings."""
        if self.path is not None or self._given is not None:
            return False
        read = self.__dict__.get("sionna")  # a user may have added objects
        return read is None or not read.objects

    @cached_property
    def interior(self) -> Interior | None:
        """Free space of a room, from the scene file's `.toml` sibling; None without such a file.

        Raises:
            SceneError: the file cannot be used.
        """
        return None if self.path is None else read_interior(self.path.with_suffix(".toml"))

    @cached_property
    def sionna(self) -> Any:
        """The `sionna.rt.Scene`, with the permittivities of this package.

        Raises:
            SceneError: the file cannot be read as a scene.
            BackendError: Mitsuba cannot run here.
        """
        from rfgen_sionna.scene.mitsuba_backend import ensure_backend
        from rfgen_sionna.scene.radio_materials import follow, retune

        variant = ensure_backend()
        if self._given is not None:
            scene = self._given
            retune(scene, self.outside)
        elif self.path is None:
            import sionna.rt

            scene = sionna.rt.load_scene()
        else:
            scene = _read(self.path, variant, self._materials)
            self._shapes = shapes_by_name(self.path)  # once: the file may be gone later
            retune(scene, self.outside)
            for name, of in self._materials.items():
                follow(scene.radio_materials[name.removeprefix("mat-")], of)
        if self.frequency is not None:
            scene.frequency = self.frequency
        return scene

    @cached_property
    def objects(self) -> tuple[StaticObject, ...]:
        """Static meshes of the Sionna scene at the first access or the last :meth:`tune`. Sensing targets and
        velocities are ignored (:meth:`warn_unfollowed`).

        Raises:
            SceneError: the file cannot be read as a scene.
            MaterialError: an object's material has no permittivity.
        """
        if self.is_free_space:
            return ()
        from rfgen_sionna.scene.radio_materials import from_sionna

        scene, materials, found = self.sionna, dict[str, Material](), list[StaticObject]()
        targets, moving = list[str](), list[str]()
        for name, item in scene.objects.items():
            if type(item).__name__ == "SensingTarget":
                targets.append(name)
                continue
            vertices, faces = _arrays(item.mi_mesh)
            if self.path is not None:
                vertices, faces = exact_mesh(self.path, name, self._shapes.get(name), vertices, faces)
            vertices, faces = _with_area(vertices, faces)
            if not len(faces):
                continue
            of = item.radio_material
            if of.name not in materials:
                try:
                    materials[of.name] = from_sionna(of, self.outside)
                except MaterialError as error:
                    raise MaterialError(f"object {name!r}: {error}") from error
            found.append(StaticObject(name, materials[of.name], vertices, faces))
            if np.any(np.asarray(item.velocity) != 0.0):
                moving.append(name)
        self._unfollowed = tuple(targets), tuple(moving)
        if self.frequency is not None:
            warn_uncovered([o.properties for o in found], self.frequency, stacklevel=3)
        return tuple(found)

    def warn_unfollowed(self) -> None:
        """Warn of sensing targets and velocities in the Sionna scene, which `objects` ignore."""
        targets, moving = self._unfollowed
        if targets:
            warnings.warn(
                f"Sionna's sensing targets are left out of the surroundings: {', '.join(targets)}; give them as actors",
                stacklevel=3,
            )
        if moving:
            warnings.warn(
                f"objects stand still in the surroundings, whatever their velocity: {', '.join(moving)}; make actors "
                "of them to let them move",
                stacklevel=3,
            )

    def tune(self, frequency: float) -> None:
        """Set the carrier frequency [Hz] of the Sionna scene, read its objects again, and warn once of materials that
        are not covered.

        Raises:
            ValueError: the frequency is not positive.
            SceneError: the scene has sensing targets, with which Sionna cannot change the frequency.
            MaterialError: the policy is "raise" and a material is not covered.
        """
        if not (np.isfinite(frequency) and frequency > 0.0):
            raise ValueError(f"frequency: {frequency!r} given, a positive value [Hz] is needed")
        known, self.frequency = self.frequency, None
        self.__dict__.pop("objects", None)
        objects = self.objects
        if frequency == known:
            self.frequency = known
            return
        for item in objects:
            if self.outside == "raise":
                item.properties.check(frequency, item.name)
        if not self.is_free_space:
            targets = [name for name, item in self.sionna.objects.items() if type(item).__name__ == "SensingTarget"]
            if targets and not np.isclose(float(self.sionna.frequency[0]), frequency, rtol=1e-6):
                raise SceneError(
                    f"scene {self.name!r}: Sionna cannot go from {float(self.sionna.frequency[0]) / 1e9:g} to "
                    f"{frequency / 1e9:g} GHz with sensing targets in it ({', '.join(targets)}); set its frequency "
                    "before they are added, or remove them"
                )
            if not targets:
                self.sionna.frequency = frequency
        self.frequency = float(frequency)
        warn_uncovered([o.properties for o in objects], frequency, stacklevel=2)


def _read(path: Path, variant: str, materials: Mapping[str, Material]) -> Any:
    """Sionna's `load_scene` with the materials of this package, unmerged shapes, and no evaluation at 3.5 GHz."""
    import mitsuba
    import sionna.rt
    from sionna.rt.scene_utils import process_xml

    from rfgen_sionna.scene.radio_materials import register, use_our_materials, with_radio_materials

    register(variant)
    mi: Any = mitsuba  # untyped functions
    before = mi.file_resolver()
    resolver = mi.FileResolver(before)
    resolver.append(str(path.parent))
    try:
        mi.set_file_resolver(resolver)
        tree = scene_tree(path, list(map(bare_name, materials)))
        text = with_radio_materials(ElementTree.tostring(tree, encoding="unicode"), dict.fromkeys(materials, "vacuum"))
        description = use_our_materials(process_xml(text, merge_shapes=False))
        return sionna.rt.Scene(mi_scene=mi.load_string(description, optimize=False))
    except SceneError:
        raise
    except Exception as error:  # Mitsuba and Sionna raise RuntimeError, ValueError, TypeError, …
        raise SceneError(f"scene file {str(path)!r} cannot be loaded: {error}") from error
    finally:
        mi.set_file_resolver(before)


def _arrays(mesh: Any) -> tuple[FloatArray, IntArray]:
    # Copies: on the CPU NumPy shares Dr.Jit's memory.
    vertices = np.array(mesh.vertex_positions_buffer(), np.float64).reshape(-1, 3)
    return vertices, np.array(mesh.faces_buffer(), np.int32).reshape(-1, 3)


def _with_area(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    area = np.linalg.norm(face_normals(vertices, faces), axis=1)
    used, faces = used_vertices(np.ascontiguousarray(faces[area > 0.0]))
    return vertices[used], faces
