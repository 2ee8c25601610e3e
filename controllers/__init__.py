"""What runs on a robot's computer. A controller sees only what sensors give it."""
