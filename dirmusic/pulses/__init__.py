"""Detected pulses: strengths, tables of pulses, and kinds of discharges."""
