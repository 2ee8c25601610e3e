"""Handovers between a free-flyer and a person, simulated or led from outside. [Fernandes2020] secs. 4.3, 5.5."""
