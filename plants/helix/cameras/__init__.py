"""The two cameras, and the scene that they paint."""
