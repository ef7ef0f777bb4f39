"""Furnished places, drawn from a seed. The import starts neither Mitsuba nor Sionna."""

from rfgen_sionna.scene.furnished.catalogue import PLACES, furnished
from rfgen_sionna.scene.furnished.furnished_scene import FurnishedScene, Layout
from rfgen_sionna.scene.furnished.layout import Item

__all__ = ["PLACES", "FurnishedScene", "Item", "Layout", "furnished"]
