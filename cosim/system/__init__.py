"""Units, parameters and connections, checked before anything starts: loops, schedule, signals."""

from handover.cosim.system.system import System

__all__ = ["System"]
