"""Parameters and start values of inputs are those that were set, whatever a unit does when it is set up, or refused."""

import json
from fractions import Fraction
from typing import Any

import pytest
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.exceptions import InitializationError
from handover.cosim.fmu.failures import StartValuesLost
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System

STANDARDS = pytest.mark.parametrize("fmi", [2, 3])
START: dict[str, Any] = {"k": 7.0, "n": 11, "on": True, "u": 5.0}


def alone(name: str, fmi: int, **start: Any) -> System:
    s = System()
    s.add("unit", native_fmu(name, fmi), **start)
    return s


@pytest.mark.parametrize(("fmi", "compiled"), [(2, True), (3, False)])
def test_values_that_a_unit_resets_as_it_is_set_up_hold(fmi: int, compiled: bool):
    """An input that another unit feeds has the value of its source."""
    s = alone("resets", fmi, **START)
    source, fed = s.add("source", native_fmu("gain", fmi), b=4.0), s.add("fed", native_fmu("resets", fmi), **START)
    s.connect(source.y.y, fed.u.u)
    with Master(s, MasterOptions(compiled=compiled)) as master:
        for stop in (None, Fraction(1, 2)):
            if stop:
                master.run(stop)
            assert float(master.signals["unit.y"]) == 7.0 * 5.0 + 11
            assert float(master.signals["fed.y"]) == 7.0 * 4.0 + 11


@STANDARDS
def test_all_values_that_do_not_hold_are_reported_at_once(fmi: int, wording: Wording):
    s = alone("keeps_constants", fmi, **START)
    s.add("other", native_fmu("keeps_single_precision", fmi), k=0.1)
    with pytest.raises(InitializationError) as caught, Master(s):
        pass
    failure = caught.value.failure
    assert isinstance(failure, StartValuesLost)
    wording.check(caught.value)
    assert "\n" not in str(caught.value)
    data = json.loads(json.dumps(failure.as_data()))
    assert (data["kind"], data["instance"], data["time"]) == ("start_values_lost", "unit, other", 0.0)
    assert data["values"][1] == {"name": "unit.n", "given": "11", "found": "2"}


@STANDARDS
def test_rounding_is_no_loss(fmi: int):
    degree = 3.141592653589793 / 180
    numbers = [k for k in (0.1 * i for i in range(1, 200)) if k * degree / degree != k][:12]
    s = System()
    for i, k in enumerate(numbers):
        s.add(f"u{i}", native_fmu("keeps_radians", fmi), k=k)
    with Master(s):
        pass
    assert len(numbers) == 12


@STANDARDS
def test_what_cannot_be_read_is_not_judged_and_the_rest_is(fmi: int):
    with Master(alone("keeps_in_secret", fmi, **START)) as master:
        assert float(master.signals["unit.y"]) == 7.0 * 5.0 + 11
        assert list(master.ensemble.instances["unit"].log) == []
        master.run(Fraction(1, 2))  # that it refused to be read is not a failure
    with Master(alone("resets_in_secret", fmi, **START)) as master:
        instance = master.ensemble.instances["unit"]
        (u,) = instance.read([instance.description.inputs["u"]])
        assert u.views["u"][0].tolist() == [5.0]
