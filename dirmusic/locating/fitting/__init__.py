"""Positions of findings from their pulses: by strengths or bearings, with the errors of the array or without."""
