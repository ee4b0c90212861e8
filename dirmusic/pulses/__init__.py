"""Detected pulses: preprocessing, strengths, records, and kinds of discharges."""
