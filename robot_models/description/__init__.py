"""Robots described by MJCF files: reading, checks and measures."""
