"""Films of runs: the scene beside plots over time, drawn in a browser without a window, frame by frame."""
