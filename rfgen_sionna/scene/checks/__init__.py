"""Checks of the places of radars and actors in a scene."""
