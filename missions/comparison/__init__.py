"""What a change of array, estimator or robot is worth, over many missions."""
