"""Routes: a leg from the radar to a facet, the facet, and a leg back; legs go by mirrors and through slabs.

==================  =====================================================================
module              content
==================  =====================================================================
`reflectors`        planar parts of surfaces, and the mirrors that they are at one time
`legs`              images of the radar in a chain of mirrors, their segments and windows
`leg_visibility`    item buffers from the images: visible share of each facet
`image_tree`        legs and routes that matter, by an upper bound
`route_trace`       paths of all routes over an interval
==================  =====================================================================
"""
