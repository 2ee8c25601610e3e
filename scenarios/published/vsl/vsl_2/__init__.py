"""Experiment 2 of [Gandarias2020]: paths by rigid kinematics and by learned corrections."""
