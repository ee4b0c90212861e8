"""What discharges: sources, pulse trains, pulse shape."""
