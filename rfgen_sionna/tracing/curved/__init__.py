"""What bent surfaces show of one another, by geometrical optics.

===============  =================================================
module           what
===============  =================================================
`surface_model`           the smooth surface under a mesh
`media`          Fresnel's coefficients
`passage`        a wave by way of bent mirrors
`elements`       elements of a radar
`bands`          polynomials over the band
`pieces`         pieces of bent faces, and where rays go from them
`pairs`          pairs of them that may show one another
`places`         where on both a ray comes back: Newton's method
`double_bounces`         what a wave is like there
`search`         all glints at an instant
`doubts`         what geometrical optics may be wrong by
`round_bounces`  returns by way of them, over time
===============  =================================================
"""
