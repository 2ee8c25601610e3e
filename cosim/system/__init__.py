"""Units, parameters and connections, checked before anything starts: loops, schedule, signals."""
