"""Physical optics of one facet in closed form, as frozen kernels of Dr.Jit.

=============  ============================================================
module         content
=============  ============================================================
`simplex`      means of a linear phase over a triangle
`quadratic`    means of a quadratic phase over a triangle
`obliquity`    Fresnel coefficients and polarimetric obliquity
`slabs`        transmission through slabs
`reflected`    facets via plane mirrors
`triangle`     gain of one triangle
`facet`        gains of all facets at all nodes: the kernel
`propagation`  delays, delay rates and phasors
=============  ============================================================
"""
