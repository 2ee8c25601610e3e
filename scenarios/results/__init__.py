"""A run's folder, written and read; its summary is made here, in one place."""
