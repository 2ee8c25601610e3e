"""The Helix takes a ball from a hand."""
