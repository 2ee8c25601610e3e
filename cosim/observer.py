"""Who looks on while a run goes on."""

from collections.abc import Callable

from handover.cosim.signals import Signals

Observer = Callable[[float, Signals], None]
"""Called at every communication point with the time in seconds and the signals that hold at that time."""
