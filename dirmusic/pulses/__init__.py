"""Detected pulses: strengths, records, and kinds of discharges."""
