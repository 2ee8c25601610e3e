"""What the Helix sees: ball, wrist and gripper in the pictures of calibrated cameras."""
