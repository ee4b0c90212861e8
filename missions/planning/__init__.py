"""Where each site of a yard is heard from, few stops that hear all of them, and a short tour past these."""
