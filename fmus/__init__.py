"""Turns a block into an FMU: FMI runtime (C), slave side (Python), builder and catalog."""
