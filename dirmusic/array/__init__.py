"""Antenna array: patterns, manifold, errors of the elements, calibration and bounds."""
