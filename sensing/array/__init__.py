"""Antenna array: configuration, the array as built, and tables for compiled functions."""
