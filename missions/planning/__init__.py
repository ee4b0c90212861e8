"""Planning: places from which each site is detectable, a small set of stops that covers all sites, and a short tour."""
