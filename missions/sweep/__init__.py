"""Sweeps of many missions: planning, running in parallel, storing a row for each mission, and statistics."""
