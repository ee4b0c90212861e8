"""Antenna array: configuration, array as built, and tables for compiled functions."""
