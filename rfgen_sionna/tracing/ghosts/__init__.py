"""Ghosts: returns of moving surfaces via plane mirrors of the static scene."""
