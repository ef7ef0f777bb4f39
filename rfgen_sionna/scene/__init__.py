"""Scenes at radar frequencies: materials, actors, static meshes, rays.

The import starts neither Mitsuba nor Sionna; the first scene that is read or traced does.
"""

from rfgen_sionna._deprecation import former_names
from rfgen_sionna.scene.checks.radar_distance import check_radar_clear
from rfgen_sionna.scene.devices import add_radar, radar_alone, tabulated
from rfgen_sionna.scene.load import available_scenes, load_scene
from rfgen_sionna.scene.materials import MATERIALS, Material, canonical_name, material
from rfgen_sionna.scene.mesh import check_mesh, face_normals
from rfgen_sionna.scene.mesh_actor import MeshActor, rotation_matrix
from rfgen_sionna.scene.rays import Hits, RayScene
from rfgen_sionna.scene.rigid_mesh import RigidMesh
from rfgen_sionna.scene.scene import RadarScene, StaticObject
from rfgen_sionna.scene.scene_errors import (
    BackendError,
    CoarseMeshWarning,
    MaterialError,
    MaterialRangeWarning,
    MeshError,
    PlacementError,
    SceneError,
)

__all__ = [
    "MATERIALS",
    "BackendError",
    "CoarseMeshWarning",
    "Hits",
    "Material",
    "MaterialError",
    "MaterialRangeWarning",
    "MeshActor",
    "MeshError",
    "PlacementError",
    "RadarScene",
    "RayScene",
    "RigidMesh",
    "SceneError",
    "StaticObject",
    "add_radar",
    "available_scenes",
    "canonical_name",
    "check_mesh",
    "check_radar_clear",
    "face_normals",
    "load_scene",
    "material",
    "radar_alone",
    "rotation_matrix",
    "tabulated",
]

__getattr__ = former_names(__name__, {"Actor": "MeshActor"})
