"""Geometry: outlines of blocks, and the points at which they touch."""
