"""Sionna's own paths as radar paths, and actors as sensing targets in its scenes."""
