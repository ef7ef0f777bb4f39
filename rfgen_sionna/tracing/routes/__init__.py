"""Routes: a leg from the radar to a facet, the facet, and a leg back; legs go by mirrors and through slabs.

==================  =====================================================================
module              content
==================  =====================================================================
`planar_parts`      planar parts of surfaces
`reflectors`        the mirrors that they are at one time, and which of two parts is the mirror
`legs`              images of the radar in a chain of mirrors, their segments and windows
`leg_visibility`    item buffers from the images: visible share of each facet, slabs crossed
`slab_scene`        which surfaces transmit, and the delays of slabs
`image_tree`        legs and routes that matter, by an upper bound
`route_trace`       paths of all routes over an interval
==================  =====================================================================
"""
