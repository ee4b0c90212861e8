"""Robots and yards: the physical world in MuJoCo. Import its modules by name."""
