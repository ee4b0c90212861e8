"""From a wish to a wheel command: map, shortest paths, path following, and the collision guard."""
