"""Repeated inspections of one yard: discharges that are new, have grown or are gone."""
