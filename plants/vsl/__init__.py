"""The arm with links of variable stiffness: its chain, motors, air and sensors."""
