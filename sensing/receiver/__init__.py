"""Receivers: configuration, band-pass filter, sampling, detection, and banks of receivers."""
