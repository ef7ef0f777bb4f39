"""The ray mode: tubes of rays that leave the radar, are reflected or go through slabs, and are integrated where they
land.

It shares the scene, the materials, the closed-form means over triangles and the rule which of two flat parts is the
mirror with the facet tracer, and nothing else: neither facets nor mirrors, visibility, expansions or Fresnel code. So
it is a second opinion, and it has what the facet tracer lacks: bounces by bent surfaces of any number, and integrals
where that has glints.

==============  =====================================================================================================
module          what
==============  =====================================================================================================
`lattice`       directions as whole numbers on an octahedron, so that neighbours share rays
`skin`          the smooth surface under the mesh: where rays meet it, its normal and how it bends
`hits`          rays followed from hit to hit, each traced once
`sampling`      where more rays go: the tubes, cut where what they hit changes
`rims`          where one thing ends before another: shadows' edges
`parallax`      what pairs of elements see otherwise beside these than the phase centre
`media`         Fresnel's coefficients and slabs, in NumPy
`passage`       field and path length from an element to a point by way of bent mirrors
`footprints`    integrals over where tubes land, for every element pair over the band
`shoot`         all of it, to paths
==============  =====================================================================================================
"""
