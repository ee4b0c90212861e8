"""Propagation of radio waves from sources to antennas: geometry, materials, ray paths and arrivals."""
