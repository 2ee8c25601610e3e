"""Invalid wiring, rejected before anything starts: clocks that cannot tick, two units where only one is allowed."""

from pathlib import Path

import pytest
from support.cosim.native_units import Edited, native_fmu

from handover.cosim.exceptions import InvalidFmu, NotExportable, ScheduleError, WiringError
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.ssp.writing import write_ssp
from handover.cosim.stepping.options import AdaptiveStep, Extrapolation, MasterOptions
from handover.cosim.system.system import PortName, System


def faults_of(s: System) -> tuple[str, ...]:
    with pytest.raises(WiringError) as refused:
        Master(s)
    return refused.value.faults


@pytest.mark.parametrize(
    ("source", "target", "fault"),
    [
        ("a.count", "b.tick", "a clock can be connected with a clock only"),
        ("a.carry", "b.increment", "a clock can be connected with a clock only"),
        ("b.tick", "a.carry", "an output clock triggers an input clock, not the other way round"),
        ("b.carry", "a.tick", "it is time-based; only a triggered input clock can be connected"),
    ],
)
def test_clocks_that_do_not_fit_are_reported(source: str, target: str, fault: str):
    s = System()
    s.add("a", native_fmu("counter_tenths"))
    s.add("b", native_fmu("counter_triggered"))
    s.connect(PortName(*source.split(".")), PortName(*target.split(".")))
    assert faults_of(s) == (f"{source} -> {target}: {fault}",)


def test_clocked_ports_need_event_mode():
    s = System()
    s.add("a", native_fmu("counter_tenths", hasEventMode=False))
    s.add("b", native_fmu("counter_thirds"), sampled=True)
    reached = "carried, count, increment can be reached only while a clock ticks, in event mode"
    assert faults_of(s) == (
        f"a: {reached}, which its FMU does not have (hasEventMode)",
        f"b: {reached}; it cannot be placed as a sampled unit, which runs without",
    )


def test_a_unit_with_clocked_ports_is_not_taken_for_a_sampled_one():
    d = describe_fmu(native_fmu("counter_tenths", canHandleVariableCommunicationStepSize=False))
    assert not d.sampled
    assert describe_fmu(native_fmu("discrete_passer", canHandleVariableCommunicationStepSize=False)).sampled


def test_a_clock_that_never_ticks_is_no_clock(edited: Edited):
    file = edited("counter_tenths", 3, ('intervalCounter="1"', 'intervalCounter="0"'))
    with pytest.raises(InvalidFmu, match=r"its clock 'tick' ticks every 0 s from 0 s on"):
        describe_fmu(file)


def test_inputs_are_not_extrapolated_to_events():
    s = System()
    s.add("ball", native_fmu("ball"))
    linear = Extrapolation.LINEAR
    with pytest.raises(ScheduleError, match=r"steps may end off it at events \(ball\): let inputs be held"):
        Master(s, MasterOptions(extrapolation=linear))
    s = System()
    s.add("short", native_fmu("discards"))
    with pytest.raises(ScheduleError, match=r"steps may end off it when one is discarded: let inputs be held"):
        Master(s, MasterOptions(extrapolation=linear, repeat_discarded=True))


def test_clock_connections_are_not_exported_silently(tmp_path: Path):
    s = System()
    a, b = s.add("a", native_fmu("counter_tenths")), s.add("b", native_fmu("counter_triggered"))
    s.connect(a.y.carry, b.u.tick)
    with pytest.raises(NotExportable, match=r"a.carry -> b.tick lets a clock tick"):
        write_ssp(s, tmp_path / "clocks.ssp", "clocks")


def test_the_step_does_not_follow_the_error_across_events():
    s = System()
    s.add("ball", native_fmu("ball"))
    with pytest.raises(ScheduleError, match=r"cannot follow the error: ball has events"):
        Master(s, MasterOptions(adaptive=AdaptiveStep()))
