"""What the Helix's fingers feel of a ball by infrared light, and how that corrects what its cameras see."""
