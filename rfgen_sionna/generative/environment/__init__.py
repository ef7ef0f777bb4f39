"""Images of surroundings: rendering furnished places, and models that draw them.

Importing it imports neither torch nor Mitsuba.
"""
