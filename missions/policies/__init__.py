"""Who drives."""
