"""Repeated inspections of one yard: what is new, grown, gone."""
