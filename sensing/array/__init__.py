"""Array of antennas: configuration, the array as built, and tables for compiled functions."""
