"""What moves, over stretches of time.

============  ==============================================================
module        what
============  ==============================================================
`knots`       at which times delays are known
`sample_times`    at which gains and shadows are traced
`facets`      facets as fine as the motion asks for
`clusters`     small neighbouring facets that make one path
`faint`       facets that return next to nothing
`views`       how much of facets is seen, from the phase centre and by pairs
`sight`       what is seen at some instants
`per_element`  what pairs of elements see from their own places
`slab_edges`  what slabs let through beside the edges of their shadows
`returns`     what it returns
`fading`      what goes behind something, when it is seen best
`missed`      errors of splines between instants
`refinement`     looks between instants, where shadows' edges pass
`indirect`     what is seen by further ways: mirrors, slabs, bent surfaces
`interval`     what is known of a stretch while it is traced
`precision`   facets and expansion as fine as the tolerance asks for
`parts`       all of it
============  ==============================================================
"""
