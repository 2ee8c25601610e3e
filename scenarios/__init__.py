"""Experiments: units wired into systems, the command line, and what a run leaves behind."""
