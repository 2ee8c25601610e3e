"""The master: it checks and loads a system, chooses how it is stepped, and runs it."""

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions

__all__ = ["AdaptiveStep", "Algorithm", "Extrapolation", "Master", "MasterOptions"]
