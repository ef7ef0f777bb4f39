"""Motion from words: a text-conditioned diffusion model of human movement.

Importing it is light: torch, diffusers and the weights are loaded at first use.
"""
