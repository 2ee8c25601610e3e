"""A user study on one computer: its plan, the order of rounds, what sessions leave behind, and what follows from it."""
