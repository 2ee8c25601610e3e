"""Experiments that an FMU contains: their manifest and tables, how one is played, and how its result is compared."""
