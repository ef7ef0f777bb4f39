"""Furnished places, drawn from a seed: surroundings that are modelled and exact.

Importing it imports neither Mitsuba nor Sionna.
"""

from rfgen_sionna.scene.furnished.catalogue import PLACES, furnished
from rfgen_sionna.scene.furnished.furnished_scene import FurnishedScene, Layout
from rfgen_sionna.scene.furnished.layout import Item

__all__ = ["PLACES", "FurnishedScene", "Item", "Layout", "furnished"]
