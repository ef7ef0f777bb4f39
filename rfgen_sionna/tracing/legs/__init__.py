"""Legs: how the radar sees a facet, by mirrors and through slabs.

================  =====================================================================
module            content
================  =====================================================================
`leg`             images of the radar in a chain of mirrors, their segments and windows
`leg_visibility`  item buffers from the images: visible share of each facet, slabs crossed
`slab_scene`      which surfaces transmit, and the delays of slabs
================  =====================================================================
"""
