"""Many missions: planned, run side by side, kept row by row so that nothing is lost, and summed up."""
