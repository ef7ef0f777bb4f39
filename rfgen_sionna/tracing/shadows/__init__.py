"""Visibility of static facets by rays: adaptive sampling, silhouettes, visible polygons and shadow boundaries."""
