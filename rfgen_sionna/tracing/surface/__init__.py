"""Smooth surfaces sampled by meshes, and facets: pieces of them at one time.

=================  =========================================================
module             content
=================  =========================================================
`surfaces`         surfaces of a scene, static and moving
`smoothing`        normals at the corners of a mesh's faces
`quadratic_patch`  quadratic displacement of facets from flat triangles
`resolution`       largest allowed facet size
`tessellate`       division of faces into facets
`facet_positions`  positions, orientations and estimated returns of facets
`facets`           facets of several surfaces, in arrays
`facet_mesh`       facets of several surfaces over all times, for compiled kernels
=================  =========================================================
"""
