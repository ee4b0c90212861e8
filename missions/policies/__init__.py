"""Policies: what decides where the robot drives."""
