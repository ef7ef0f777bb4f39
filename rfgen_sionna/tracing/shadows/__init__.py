"""What is seen of facets, and from where.

===============  ===================================================
module           what
===============  ===================================================
`silhouettes`       rays that just pass the outlines of bodies
`cones`          what actors may hide, at a glance
`terminator`        where round things turn out of sight
`lattices`       lattices of points on facets
`cells`          their cells that a shadow's edge cuts, in triangles
`lines`          the lit parts of facets that a shadow's edge passes
`looking`        points on lattices tell what is seen
`return_bounds`  upper bounds on returns of facets and strips
`sampling`       RF adaptive sampling: rays where they matter
`visibility`     what mirrors show of facets
`terminator`           what the rims of slabs and mirrors leave of facets
`edges`          straight pieces of shadows' edges
`correction`         integrals over strips beside shadows' edges
`boundary_correction`       what each pair of elements sees of these
===============  ===================================================
"""
