"""Receiver: configuration, band-pass, sampling, detection and banks of receivers."""
