"""Saved states of several units."""

from collections.abc import Mapping

from handover.cosim.fmu.calls import State
from handover.cosim.stepping.linear_inputs import Memory


class SavedStates(dict[str, State]):
    """Saved states by unit, with what the extrapolation of inputs remembers of these units."""

    def __init__(self, states: Mapping[str, State], lines: Mapping[str, Memory]) -> None:
        super().__init__(states)
        self.lines = lines
