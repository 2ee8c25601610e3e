"""The Helix and its world: the tendon-driven soft arm, the hand that offers a ball, the cameras' pictures."""
