"""The Helix's published experiments, and those beyond them."""
