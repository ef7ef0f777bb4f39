"""Facet gains of all element pairs over the band.

===========  =========================================
module       what
===========  =========================================
`beam`       the antennas' gain towards places
`diffuse`    what rough surfaces add
`expansion`  gains of all pairs from a few values
`probes`     exact gains of some pairs to compare with
`band`       facet gains over the band
`accuracy`   what they err by
===========  =========================================
"""
