"""Bodies: anny's parametric person, or the user's SMPL model, as a rigged mesh, and motions performed by it."""

from rfgen_sionna.generative.bodies.animate import animate
from rfgen_sionna.generative.bodies.phenotype import Phenotype, PhenotypeError, describe, person
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence
from rfgen_sionna.generative.bodies.smpl_rig import BodyFileError, smpl_file, smpl_person

__all__ = [
    "BodyFileError",
    "BodySequence",
    "Phenotype",
    "PhenotypeError",
    "Rig",
    "animate",
    "describe",
    "person",
    "smpl_file",
    "smpl_person",
]
