"""Films of runs: the scene beside plots over time, drawn in a browser without a window, frame by frame."""

SMALLEST, LARGEST = 240, 7680
"""Pixels of a film's width and height at least and at most."""
