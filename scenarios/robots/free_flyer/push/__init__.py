"""A push against a free-flyer's gripper, whose arm is fixed or gives way, too. [Fernandes2020] secs. 3.3, 4.3."""
