"""What the plane mirrors of the static scene show of what moves.

===============  =============================================
module           what
===============  =============================================
`mirrors`        walls, floor, ceiling, table tops
`levels`         how strong ghosts are, before they are traced
`sight`          what mirrors show of facets
`image_band`     facet gains by way of mirrors
`image_returns`  returns by way of mirrors, as paths
`ghosts`         all of it
===============  =============================================
"""
