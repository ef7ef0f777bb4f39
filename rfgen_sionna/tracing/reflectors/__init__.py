"""Reflections by planar parts of any surface, moving or not: corner reflectors, boards, furniture."""
