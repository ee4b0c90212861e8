"""How a command ends: signals, and what the machine denies."""
