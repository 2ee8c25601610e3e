"""A run under way in a browser: its scene, its signals, and the controls of its pace."""
