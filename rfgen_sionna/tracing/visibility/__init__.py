"""Visibility of facets: item buffers from the phase centre, on one core.

=============  ===============================================================
module         content
=============  ===============================================================
`rasterise`    kernels: nearest facet of each pixel, pixels of each facet
`item_buffer`  views around moving surfaces, visible fractions, shadow maps
`slab_layers`  kernels: slabs before each facet
=============  ===============================================================
"""
