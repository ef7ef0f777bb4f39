"""Physical optics of one facet in closed form, in two kernels.

Actors and routes take `patch_gains`, compiled by Numba. The static scene, images and far fields take `facet`, frozen
kernels of Dr.Jit.

================  ============================================================
module            content
================  ============================================================
`patch_gains`     gains of quadratic patches by any legs: the compiled kernel
`patch_geometry`  points, area elements and clipping of quadratic patches
`leg_fields`      fields and delays by mirrors and through slabs
`fresnel`         Fresnel coefficients and obliquity, in scalars
`phasor_moments`  means of phasors over a triangle, in scalars
`simplex`         means of a linear phase over a triangle
`quadratic`       means of a quadratic phase over a triangle
`obliquity`       Fresnel coefficients and polarimetric obliquity
`slabs`           materials with a thickness, and their transmission
`triangle`        gain of one triangle
`facet`           gains of all facets at all nodes: the frozen kernel
`propagation`     delays, delay rates and phasors
================  ============================================================
"""
