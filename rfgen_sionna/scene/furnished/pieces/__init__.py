"""Pieces of furniture and outdoor objects, each a function of a random generator."""
