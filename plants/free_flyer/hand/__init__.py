"""A person's hand, the object, and how both hand and gripper hold it, in microgravity."""
