"""What a scenario is written with: parameters, wiring, evaluation, plots, replay, published values."""
