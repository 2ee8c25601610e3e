"""One FMU: the file, what it says of itself, and its instance behind the same calls for FMI 2 and FMI 3."""
