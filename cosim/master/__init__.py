"""The master: it checks and loads a system, chooses how it is stepped, and runs it."""
