"""Robots and yards: the physical world, simulated with MuJoCo. Import its modules by name."""
