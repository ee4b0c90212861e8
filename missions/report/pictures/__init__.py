"""Pictures of a report: the site plan, and of each finding its phase-resolved pattern and whence it was detected."""
