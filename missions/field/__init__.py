"""Field data: reading them, and locating discharges in them."""
