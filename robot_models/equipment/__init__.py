"""Substation equipment: shapes and colours by kind."""
