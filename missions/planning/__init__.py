"""Planning: where each site of a yard is detectable, few stops that cover all sites, and a short tour past them."""
