"""A mission as a film, from its log alone: the robot as it drives, beside the plan as it stood."""
