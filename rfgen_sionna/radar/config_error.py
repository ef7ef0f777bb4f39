"""What is raised where a radar file cannot be followed."""


class RadarConfigError(ValueError):
    """A radar file says something that no radar can do, or in words the format does not know."""
