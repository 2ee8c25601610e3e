"""The catalogued units in FMPy, a host that knows nothing of this project."""

import json
import xml.etree.ElementTree as ET
import zipfile

import fmpy
import numpy as np
import pytest
from support.fmus.validity import problems_of

from handover.cosim.fmu.file.archive import TERMINALS
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.fmpy_edge import terminal_problems
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.plants.helix.arm.tendon_arm import Inputs, TendonArm
from handover.plants.helix.arm.tendon_parameters import Params

DL = np.array([-0.01, 0.005, 0.005, -0.02, 0.01, 0.01, 0.0, -0.015, -0.015])

PICTURES = ("StereoCamera", "HandoverVision")
"""Units with picture ports, which FMI 2 does not know."""

IN_FMI2 = (*PICTURES, "FreeFlyer", "HandoverStateMachine", "TendonArm")
"""Units whose FMI 2 form is tried; what differs between the forms is not the unit's."""


@pytest.mark.parametrize(
    ("name", "fmi"), [*((n, 3) for n in UNITS), *(pytest.param(n, 2, marks=pytest.mark.slow) for n in IN_FMI2)]
)
def test_every_unit_is_valid_or_says_why_it_has_no_such_form(name: str, fmi: int):
    try:
        file = cached(name, fmi)
    except NoFmi2Form:
        assert fmi == 2
        assert name in PICTURES
        return
    assert problems_of(file) == []
    d = describe_fmu(file)
    steps = 0 if d.experiment.stop is None or d.step is None else d.experiment.stop / d.step
    assert steps == pytest.approx(round(steps), abs=1e-9)  # a host that takes both as they are ends with a whole step
    assert 1 <= steps <= 1000
    terminals = d.terminals
    assert (terminals.fault, {name: t.reason for name, t in terminals.by_name.items() if t.reason}) == ("", {})
    with zipfile.ZipFile(file) as archive:
        assert (TERMINALS in archive.namelist()) is (fmi == 3 or bool(terminals.by_name))
        assert TERMINALS not in archive.namelist() or terminal_problems(archive.read(TERMINALS)) == []


def test_a_unit_lists_the_package_that_it_stands_on():
    packages = {"TendonArm": "exudyn", "HandoverVision": "opencv-python-headless", "HandoverPartner": "numpy"}
    packages |= {"TendonArmFast": "scipy", "GraspScene": "pymunk", "ImpedanceController": "control"}
    for name, package in packages.items():
        with zipfile.ZipFile(cached(name, 3)) as archive:
            listed = json.loads(archive.read("resources/unit.json"))["packages"]
        names = {p["distribution"] for p in listed}
        assert package in names
        assert "fmpy" not in names


def test_a_simulation_by_default_ends_with_a_whole_step():
    """Of 15 ms, of which 1 s, where FMPy would stop by itself, is not a multiple."""
    assert fmpy.simulate_fmu(str(cached("IrReflex", 3)))["time"] == pytest.approx(np.arange(68) * 0.015)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("name", "any_step"), [("TendonArm", "false"), ("VisualServo", "true")])
def test_only_a_unit_that_takes_any_step_says_so(name: str, any_step: str, fmi: int):
    with zipfile.ZipFile(cached(name, fmi)) as archive:
        unit = ET.fromstring(archive.read("modelDescription.xml")).find("CoSimulation")
    assert unit is not None
    assert unit.attrib["canHandleVariableCommunicationStepSize"] == any_step
    assert "fixedInternalStepSize" not in unit.attrib


def test_the_arm_alone_in_fmpy_is_the_plain_arm_bit_for_bit():
    start, output = {f"dl_t[{i + 1}]": x for i, x in enumerate(DL)}, [f"p_WG[{i}]" for i in (1, 2, 3)]
    result = fmpy.simulate_fmu(
        str(cached("TendonArm", 2)), stop_time=0.4, output_interval=0.02, start_values=start, output=output
    )
    seen = np.column_stack([result[n] for n in output])
    arm, u = TendonArm(Params()), Inputs(dl_t=DL)
    plain = [arm.outputs(0.0, u).p_WG] + [arm.step(k * 0.02, 0.02, u).p_WG for k in range(20)]
    assert np.array_equal(seen, plain)
    assert np.linalg.norm(plain[-1] - plain[0]) > 0.01
