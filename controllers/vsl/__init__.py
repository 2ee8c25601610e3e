"""What runs on the VSL arm's computer: paths, rigid and learned kinematics."""
