"""A unit under test: an isolated process that may crash or hang, the calls that it notes, and what is found in it."""
