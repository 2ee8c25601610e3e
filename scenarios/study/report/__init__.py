"""The page of a study, and its results as tables."""
