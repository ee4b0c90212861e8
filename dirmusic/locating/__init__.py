"""Locating of discharges: turns pulses with bearings into findings with positions, error ellipses and states."""
