"""Experiment 1 of [Gandarias2020]: paths by rigid kinematics."""
