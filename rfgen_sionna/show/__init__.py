"""Pictures and words about a run: a sheet, a short film, a summary."""

from rfgen_sionna.show.film import animation
from rfgen_sionna.show.page import sheet
from rfgen_sionna.show.run_view import NoPictureError
from rfgen_sionna.show.words import summary

__all__ = ["NoPictureError", "animation", "sheet", "summary"]
