"""Processing chains of boards and published data sets: from samples to the points that they report."""

from rfgen_sionna.processing.boards.board_points import BoardPoints
from rfgen_sionna.processing.boards.chain_presets import CHAINS
from rfgen_sionna.processing.boards.mmmesh_points import mmmesh_points
from rfgen_sionna.processing.boards.out_of_box import OutOfBoxChain, out_of_box_points
from rfgen_sionna.processing.boards.range_cfar import CfarSettings

__all__ = ["CHAINS", "BoardPoints", "CfarSettings", "OutOfBoxChain", "mmmesh_points", "out_of_box_points"]
