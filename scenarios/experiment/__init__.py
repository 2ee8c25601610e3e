"""What scenarios are made of: parameters, wiring, evaluation, plots, replay, published values."""
