"""The order of a unit's calls: the standards forbid to get outputs after inputs were set until a step is taken."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import pytest
from support.cosim.call_log import CallLog
from support.cosim.checkpointed_runs import oscillator

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions

START = {
    2: ["Instantiate", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode"],
    3: ["InstantiateCoSimulation", "EnterInitializationMode", "ExitInitializationMode"],
}
LINEAR = Extrapolation.LINEAR


@pytest.mark.parametrize(
    "options",
    [
        *(MasterOptions(algorithm=a, compiled=False) for a in Algorithm),
        *(MasterOptions(algorithm=a, repeat_discarded=True) for a in Algorithm),
        *(MasterOptions(algorithm=a, adaptive=AdaptiveStep(), extrapolation=LINEAR) for a in Algorithm),
    ],
    ids=lambda o: f"{o.algorithm.value} {'adaptive' if o.adaptive else 'events' if o.repeat_discarded else 'grid'}",
)
def test_outputs_are_fetched_only_after_a_step_or_a_restored_state(options: MasterOptions):
    call_log = CallLog()
    with Master(oscillator(), options, call_log) as master:
        for stop in (0, Fraction(1, 8), Fraction(1, 8), Fraction(1, 5)):
            master.run(Fraction(stop))
    for unit, fmi in (("a", 2), ("b", 3), ("between", 3)):
        calls = [call.removeprefix(f"fmi{fmi}") for name, call in call_log.calls if name == unit]
        assert [c for c in calls if c in START[fmi]] == START[fmi]
        assert calls[-2:] == ["Terminate", "FreeInstance"]
        assert _faults(calls[calls.index("ExitInitializationMode") + 1 : -2]) == []


def _faults(calls: Sequence[str]) -> list[tuple[str, str]]:
    """Return where a Get directly follows a Set; SetFMUState cancels the inputs that were set before it."""
    entries = [c for c in calls if not c.startswith(("GetFMU", "FreeFMU"))]
    return [(a, b) for a, b in pairwise(entries) if a.startswith("Set") and a[:6] != "SetFMU" and b.startswith("Get")]
