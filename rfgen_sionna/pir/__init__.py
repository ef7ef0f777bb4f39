"""Path-based intermediate representations: images of what returns to the radar's viewpoint."""

from rfgen_sionna.pir.render import render_pir

__all__ = ["render_pir"]
