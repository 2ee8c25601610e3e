"""Carries out a run: task, runner, supervised process, interruption, resuming."""
