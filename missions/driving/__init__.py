"""Driving: map with shortest paths, path following, and a speed limit from the lidar."""
