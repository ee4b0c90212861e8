"""From bearings to findings: association, births, triangulation, the fix of sources and array, confirmation."""
