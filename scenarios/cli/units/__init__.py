"""The commands about units: built, checked, described, and begun from templates or from a place in a scenario."""
