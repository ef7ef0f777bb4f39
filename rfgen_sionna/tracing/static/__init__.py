"""What stays, traced once for each radar pose, and what actors hide of it.

================  ========================================
module            what
================  ========================================
`facets`          its facets
`static_visibility`          what actors leave of facets
`trace`           its direct returns
`shadows`         what actors take from its paths
`refinement`         looks between instants at what they hide
`bounces`         what its flat parts show of one another
`round_bounces`   what its bent surfaces do
`transmission_tracer`           what of it is seen through slabs
`veiled_bounces`  by flat parts as well
================  ========================================
"""
