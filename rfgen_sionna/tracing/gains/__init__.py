"""Facet gains of all element pairs over the band.

=================  ===================================================
module             content
=================  ===================================================
`element_pattern`  two-way pattern gain and its gradient
`diffuse`          diffuse returns of rough surfaces
`expansion`        gains of all pairs over the band from few integrals
`band`             facet gains of one radar over the band
`error_estimate`   halving test of the gains
=================  ===================================================
"""
