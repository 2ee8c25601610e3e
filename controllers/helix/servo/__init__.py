"""How the Helix is led to the ball: estimation of its state, and control of its tendons."""
