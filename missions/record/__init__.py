"""What is left of a mission: log, tracking, pulses of findings, phase-resolved patterns, sites."""
