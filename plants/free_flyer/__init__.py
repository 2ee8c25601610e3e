"""The free-flying robot and its world in microgravity: body, thrusters, a person's hand and the object."""
