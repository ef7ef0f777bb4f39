"""Routes: a leg from the radar to a facet, the facet, and a leg back (:mod:`rfgen_sionna.tracing.legs`).

==============  =====================================================================
module          content
==============  =====================================================================
`planar_parts`  planar parts of surfaces
`reflectors`    the mirrors that they are at one time, and which of two parts is the mirror
`image_tree`    legs and routes that matter, by an upper bound
`route`         facets of a route, and their returns
`route_bounds`  routes and facets that are left out
`route_trace`   paths of all routes over an interval
==============  =====================================================================
"""
