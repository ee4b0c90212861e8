"""Showing recordings: in the native viewer, in a browser on this machine, while a mission runs, as a picture."""
