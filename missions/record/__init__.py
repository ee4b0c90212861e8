"""What is left of a mission: log, tracking, report, phase-resolved patterns."""
