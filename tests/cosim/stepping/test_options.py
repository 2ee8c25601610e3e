from fractions import Fraction
from typing import Any

import pytest
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import InvalidOptions, ScheduleError
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import AdaptiveStep, Extrapolation, MasterOptions
from handover.cosim.system.system import System

NAN = float("nan")
LINEAR, ADAPTIVE = {"extrapolation": Extrapolation.LINEAR}, {"adaptive": AdaptiveStep()}


@pytest.mark.parametrize(
    ("options", "given"),
    [
        (MasterOptions, {"algorithm": "newton", "adaptive": 1e-4, "max_iterations": 2.5, "tolerance": "x"}),
        (MasterOptions, {"extrapolation": "linear", "compiled": 1, "isolated": "all"}),
        *((MasterOptions, {"call_limit": x, "pace": x}) for x in (0.0, -1.0, NAN, float("inf"))),
        *((MasterOptions, {"unit_tolerances": x}) for x in ({"a": 0.0}, {"a": NAN}, {1: 1e-3}, 1e-3)),
        (AdaptiveStep, {"relative": "x", "smallest": 0.001, "uncontrolled": "arm.x"}),
        (AdaptiveStep, {"relative": -1.0, "absolute": NAN, "smallest": Fraction(0)}),
        (AdaptiveStep, {"smallest": Fraction(1, 10), "largest": Fraction(1, 100), "initial": Fraction(1, 1000)}),
        (AdaptiveStep, {"relative": 0.0, "absolute": 0.0}),
    ],
)
def test_all_that_is_none_is_refused_at_once_with_what_is_valid(
    options: type[Any], given: dict[str, Any], wording: Wording
):
    with pytest.raises(InvalidOptions) as refused:
        options(**given)
    assert len(refused.value.faults) == (1 if given.get("relative") == 0.0 else len(given) - ("largest" in given))
    wording.check(refused.value)


@pytest.mark.parametrize(
    ("units", "options"),
    [
        pytest.param({"forgetful": "mass", "rigid": "fixed_step", "ball": "ball"}, ADAPTIVE, id="fixed"),
        pytest.param({"clock": "ramp"}, ADAPTIVE, id="sampled"),
        pytest.param({"mass": "mass"}, {"adaptive": AdaptiveStep(uncontrolled=("mass.w",))}, id="uncontrolled"),
        pytest.param({"ball": "ball"}, LINEAR, id="line to events"),
        pytest.param({"short": "discards"}, {**LINEAR, "repeat_discarded": True}, id="line to a discarded step"),
    ],
)
def test_what_does_not_go_with_a_system_is_refused(units: dict[str, str], options: dict[str, Any], wording: Wording):
    s = System()
    for name, unit in units.items():
        fmu = native_fmu(unit, canGetAndSetFMUState=False) if name == "forgetful" else native_fmu(unit)
        s.add(name, fmu, sampled=name == "clock")
    with pytest.raises(ScheduleError) as refused:
        Master(s, MasterOptions(**options))
    wording.check(refused.value)
