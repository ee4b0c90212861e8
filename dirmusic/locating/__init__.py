"""Locating: from pulses with bearings to findings with positions, ellipses and states."""
