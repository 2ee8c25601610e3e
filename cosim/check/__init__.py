"""Tells of an FMU, foreign or broken, what is wrong with it: where, and what would be right."""
