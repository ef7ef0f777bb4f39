"""Pictures and words about a run: a sheet, a short film, a summary."""

from rfgen_sionna.show.animation import animation
from rfgen_sionna.show.sheet import sheet
from rfgen_sionna.show.summary import summary

__all__ = ["animation", "sheet", "summary"]
