"""What follows from a study's rounds and ratings: exact tests, a mixed model, and what so many could find."""
