"""What goes into an FMU besides sources and runtime: descriptions, terminals, icon, documentation, related files."""
