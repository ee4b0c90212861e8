"""Episodes side by side: what both environments are made of."""
