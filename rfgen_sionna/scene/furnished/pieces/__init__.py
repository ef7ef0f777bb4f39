"""Pieces of furniture and what stands outdoors, each a function of a random generator."""
