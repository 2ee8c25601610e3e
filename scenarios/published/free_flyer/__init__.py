"""The published experiments of the free-flyer's thesis."""
