"""The record of a mission: log, tracking, pulses of findings, and places where findings may be."""
