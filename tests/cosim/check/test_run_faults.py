"""Faults that a check finds in a description alone are warned of at a run, and refused by `strict`."""

import logging
from fractions import Fraction

import pytest
from fmu_of import FmuOf
from native_units import Edited, native_fmu

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System

UNLISTED = "an output that ModelStructure does not list among the outputs; a run takes it to depend on all inputs"
INVALID = [
    (2, ('<Real start="1.0" />', '<Real start="1.0" min="3" max="2" />'), "its min 3 is above its max 2"),
    (3, ('start="1.0"', 'start="1.0" min="3" max="2"'), "its min 3 is above its max 2"),
    (2, ('<Real start="1.0" />', '<Real start="1.0" max="0.5" />'), "start value 1.0 is out of its range"),
    (2, ('<Unknown index="2" dependencies="1" />', ""), UNLISTED),
    (3, ('<Output valueReference="2" dependencies="1" />', ""), UNLISTED),
    (3, ('startTime="0" stopTime="1"', 'startTime="2" stopTime="1"'), "stopTime is before startTime"),
]


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]


@pytest.mark.parametrize(("fmi", "edit", "wanted"), INVALID)
def test_a_run_warns_of_what_a_check_finds_in_the_description(
    edited: Edited, caplog: pytest.LogCaptureFixture, fmi: int, edit: tuple[str, str], wanted: str
):
    file = edited("mixed_gain", fmi, edit)
    system = System()
    system.add("gain", file)
    with caplog.at_level(logging.WARNING), Master(system) as master:
        master.run(Fraction(1))
    (line,) = warnings_of(caplog)
    assert wanted in line
    assert line.startswith(f"{file}: its modelDescription.xml is not valid: ")
    assert wanted in master.description_faults[file]
    with pytest.raises(InvalidFmu, match=wanted):
        Master(system, MasterOptions(strict=True))
    assert wanted in "\n".join(f.line for s in check_fmu(file, timeout=60.0).sections for f in s.findings)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_file_that_is_replaced_is_read_again(edited: Edited, fmi: int):
    bounds = ('start="1.0"', 'start="1.0" min="3" max="2"')
    faults = []
    for edits in ((), (bounds,), ()):
        system = System()
        system.add("gain", edited("gain", fmi, *edits))
        faults.append(len(Master(system).description_faults))
    assert faults == [0, 1, 0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_unit_that_needs_another_tool_is_told(edited: Edited, caplog: pytest.LogCaptureFixture, fmi: int):
    system = System()
    system.add("gain", edited("gain", fmi, ("<CoSimulation ", '<CoSimulation needsExecutionTool="true" ')))
    with caplog.at_level(logging.WARNING):
        Master(system, MasterOptions(strict=True))
    assert warnings_of(caplog) == [
        "gain needs other software to run, as its FMU says: the tool that exported it, or an interpreter"
    ]


def test_the_python_of_a_unit_of_this_project_is_no_other_tool(fmu: FmuOf):
    system = System()
    system.add("unit", fmu("Mass"))
    assert system.units["unit"].description.capabilities.needs_tool
    assert Master(system, MasterOptions(strict=True)).execution_tools == []


def test_sound_units_have_no_faults(caplog: pytest.LogCaptureFixture):
    for fmi in (2, 3):
        system = System()
        system.add("mass", native_fmu("mass", fmi))
        with caplog.at_level(logging.WARNING):
            Master(system, MasterOptions(strict=True))
    assert warnings_of(caplog) == []
