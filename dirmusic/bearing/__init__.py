"""Bearings from strengths: estimators, pseudo-spectrum, and detection of faulty channels."""
