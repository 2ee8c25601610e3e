"""Checks FMUs, also foreign or broken ones: reports what is wrong, where, and the remedy."""
