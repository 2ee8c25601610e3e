"""What runs on the soft hand's computer: the infrared reflex."""
