"""What runs on the Helix's computer: vision, filters, kinematics, visual servoing."""
