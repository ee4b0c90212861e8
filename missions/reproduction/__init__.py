"""Comparison of every exhibit of the Dir-MUSIC paper with the methods of this project."""
