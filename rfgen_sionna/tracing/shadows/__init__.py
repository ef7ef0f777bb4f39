"""Visibility of facets: adaptive sampling, silhouettes, visible polygons, terminator and shadow boundaries."""
