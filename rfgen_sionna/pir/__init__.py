"""Path-based intermediate representations (PIR): images of energy, time of arrival and velocity at a viewpoint."""

from rfgen_sionna.pir.fusion import image, rasterise
from rfgen_sionna.pir.render import render_pir
from rfgen_sionna.pir.view import View

__all__ = ["View", "image", "rasterise", "render_pir"]
