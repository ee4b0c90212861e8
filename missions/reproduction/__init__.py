"""Reproduction of every table and figure of the Dir-MUSIC paper, by its own methods and those of this project."""
