"""What moves, over stretches of time.

============  ==============================================================
module        what
============  ==============================================================
`knots`       at which times delays are known
`instants`    at which gains and shadows are traced
`facets`      facets as fine as the motion asks for
`patches`     small neighbouring facets that make one path
`faint`       facets that return next to nothing
`views`       how much of facets is seen, from the phase centre and by pairs
`sight`       what is seen at some instants
`own_places`  what pairs of elements see from their own places
`slab_edges`  what slabs let through beside the edges of their shadows
`returns`     what it returns
`fading`      what goes behind something, when it is seen best
`missed`      errors of splines between instants
`glances`     looks between instants, where shadows' edges pass
`further`     what is seen by further ways: mirrors, slabs, bent surfaces
`stretch`     what is known of a stretch while it is traced
`precision`   facets and expansion as fine as the tolerance asks for
`parts`       all of it
============  ==============================================================
"""
