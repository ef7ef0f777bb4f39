"""The smooth surface that a mesh stands for, and facets: pieces of it at an instant.

============  ============================================================
module        what
============  ============================================================
`surfaces`    the surfaces of a scene, static and moving
`smooth`      normals at the corners of a mesh's faces
`patch`        how faces leave their flat triangles, and pieces of them
`fineness`    how small facets have to be
`tessellate`  faces split into facets
`placing`     where they are at several times, and which look at the radar
`aslant`      about what each returns
`facets`      facets of several surfaces, in arrays
`clip`        triangles cut to half-spaces
============  ============================================================
"""
