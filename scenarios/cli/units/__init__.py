"""The commands about units: built, checked, told of, and begun from templates or from a place in a scenario."""
