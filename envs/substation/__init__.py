"""Layouts of outdoor substations as engineers draw them, and the scenarios made of them."""
