"""From bearings to findings: assignment, triangulation, and the fix of sources and array together."""
