"""Data from the field: reading them, and locating with them."""
