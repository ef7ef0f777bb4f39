"""Environment diffusion: image models of surroundings, layout maps of furnished places, path diffusion.

Torch and Mitsuba are loaded at first use, not at import.
"""
