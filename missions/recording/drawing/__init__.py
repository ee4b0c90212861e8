"""What a recording shows, one file for each part of the picture; each draws a log slice by slice."""
