"""Specular double bounces between curved surfaces, by geometrical optics."""
