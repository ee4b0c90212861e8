"""Antenna array: patterns, manifold, errors of the elements, and bounds of the bearing error."""
