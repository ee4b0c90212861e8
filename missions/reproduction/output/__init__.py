"""The exhibits for a terminal, as data, as pictures and as a page."""
