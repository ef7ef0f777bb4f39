"""Path-based intermediate representations: images of what returns to the radar's viewpoint."""

from rfgen_sionna.pir.fusion import image
from rfgen_sionna.pir.rasterisation import rasterise
from rfgen_sionna.pir.render import render_pir
from rfgen_sionna.pir.view import View

__all__ = ["View", "image", "rasterise", "render_pir"]
