"""The type of the fixture `fmu`."""

from collections.abc import Callable
from pathlib import Path

FmuOf = Callable[..., Path]
"""Takes the name of a block of master_blocks and, as `fmi`, a version of the standard; returns its FMU."""
