"""What is seen through slabs: walls, glass, clothing.

=========  ======================================
module     what
=========  ======================================
`walk`     ways that go straight on through slabs
`rims`     what the slabs' rims leave of facets
`veils`    what is seen through them directly
`landing`  where plates show facets through them
`bounces`  returns by way of plates through them
=========  ======================================
"""
