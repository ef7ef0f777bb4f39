"""Scenes at radar frequencies: materials, actors, static meshes and what rays see of them.

Importing it imports neither Mitsuba nor Sionna; they start when a scene is first loaded or traced.
"""

from rfgen_sionna.scene.actor import Actor, rotation_matrix
from rfgen_sionna.scene.errors import BackendError, MaterialError, MaterialRangeWarning, MeshError, SceneError
from rfgen_sionna.scene.materials import MATERIALS, Material, canonical_name, material
from rfgen_sionna.scene.mesh import RigidMesh, check_mesh, face_normals
from rfgen_sionna.scene.rays import Hits, RayScene

__all__ = [
    "MATERIALS",
    "Actor",
    "BackendError",
    "Hits",
    "Material",
    "MaterialError",
    "MaterialRangeWarning",
    "MeshError",
    "RayScene",
    "RigidMesh",
    "SceneError",
    "canonical_name",
    "check_mesh",
    "face_normals",
    "material",
    "rotation_matrix",
]
