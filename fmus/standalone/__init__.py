"""Freezes interpreter and packages of a unit that one can give away, and tries it before it is written."""
