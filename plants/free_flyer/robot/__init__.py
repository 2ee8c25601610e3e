"""The free-flying robot: body, arm, propulsion and navigation."""
