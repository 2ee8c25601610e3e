"""The person's hand and the ball in it: offering, contact, guidance, the bowl."""
