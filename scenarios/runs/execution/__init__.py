"""Runs an experiment once: runner, supervised child process, crashes, interruption, resuming, exit statuses."""
