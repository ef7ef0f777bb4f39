"""Legs through slabs: walls, glass, clothing."""
