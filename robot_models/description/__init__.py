"""Robots described by MJCF files: reading, validation and measurement."""
