"""How a run gets from one communication point to the next, and what its units are given on the way."""
