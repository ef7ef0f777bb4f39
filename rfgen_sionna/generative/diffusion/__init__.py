"""Motion diffusion: a text-conditioned diffusion model of human motion.

Torch, diffusers and the weights are loaded at first use, not at import.
"""
