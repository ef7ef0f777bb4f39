"""What a facet returns, in closed form, by frozen kernels of Dr.Jit.

===========  ===============================================================
module       what
===========  ===============================================================
`simplex`    means of a linear phase over a triangle
`quadratic`  those of a quadratic one
`obliquity`  Fresnel coefficients and the currents they make
`slabs`      what goes through slabs
`reflected`  facets seen by way of a plane mirror
`triangle`   the gain of a triangle
`facet`      those of all facets at all nodes: the kernel
`delays`     delays by way of places, and their rates
`phasors`    what waves turn by on their way
===========  ===============================================================
"""
