"""Policies: code that decides where the robot drives."""
