"""What is seen through slabs: walls, glass, clothing.

=========  ======================================
module     what
=========  ======================================
`slab_tracer`     ways that go straight on through slabs
`clipped`     what the slabs' rims leave of facets
`transmission_tracer`    what is seen through them directly
`footprints`  where plates show facets through them
`bounces`  returns by way of plates through them
=========  ======================================
"""
