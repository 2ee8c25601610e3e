"""The co-simulation engine: blocks, systems, schedules, the master and its records. It knows no robot."""
