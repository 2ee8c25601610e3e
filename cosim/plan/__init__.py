"""Fixed steps without events as a flat list of operations, carried out in C."""
