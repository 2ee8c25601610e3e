"""The table of the infrared grasp's published experiment."""
