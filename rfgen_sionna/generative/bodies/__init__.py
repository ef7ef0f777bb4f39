"""Bodies: anny's parametric person as a rigged mesh, and motions performed by it."""

from rfgen_sionna.generative.bodies.animate import animate
from rfgen_sionna.generative.bodies.phenotype import Phenotype, PhenotypeError, describe, person
from rfgen_sionna.generative.bodies.rig import Rig
from rfgen_sionna.generative.bodies.sequence import BodySequence

__all__ = ["BodySequence", "Phenotype", "PhenotypeError", "Rig", "animate", "describe", "person"]
