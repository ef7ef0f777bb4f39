"""Sionna's own paths, and our actors in its scenes.

===========  ================================================================
module       what
===========  ================================================================
`entries`    what `sionna.rt.Paths` says about one radar, as flat arrays
`same_path`  which paths of different element pairs are the same
`paths`      its paths as ours
`target`     actors as its sensing targets
`far_field`  scattering towards far directions, as its sensing takes it
===========  ================================================================
"""
