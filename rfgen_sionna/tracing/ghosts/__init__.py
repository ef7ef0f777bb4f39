"""Ghosts: returns of moving surfaces by way of plane mirrors of the static scene."""
