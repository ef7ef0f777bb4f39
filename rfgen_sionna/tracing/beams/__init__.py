"""Rays as pixels, for images of a scene.

============  ==================================================================
module        what
============  ==================================================================
`footprints`  what the patch that a ray stands for returns
`gloss`       what smooth surfaces show a second time of what scatters diffusely
============  ==================================================================
"""
