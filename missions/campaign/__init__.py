"""Repeated inspections of one yard: discharges that are new, grown or gone."""
