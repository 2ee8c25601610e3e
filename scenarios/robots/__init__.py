"""The robots: wiring, parameters, evaluation, plots and replay of their scenarios."""
