"""Fixed steps without events as a flat list of operations, executed in C."""
