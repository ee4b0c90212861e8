"""What stands in a yard, as data."""
