"""A scenario that was exported as an SSP, in Ecos' command line and in our own master."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from ecos_command import Ecos
from ssp_rows import SCENARIO, STEP, STEPS, exported, own_rows

from handover.cosim.ssp.ssp_file import SspFile
from handover.fmus import interpreter

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("ecospy") is None, reason="ecospy has wheels for few platforms"),
    pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that Ecos can load"),
]

TYPES = ("REAL", "INT", "BOOL")


def test_an_exported_scenario_in_ecos_is_the_same_as_in_our_own_master(tmp_path: Path):
    """To the six decimals that Ecos writes. It applies the parameter sets of the name that it is given."""
    file = exported(tmp_path)
    with SspFile(file, STEP) as ssp:
        wanted = own_rows(ssp)
    stop = float((STEPS + 0.5) * STEP)
    table = Ecos(tmp_path).simulate(tmp_path, file, float(STEP), stop, "--parameterSet", SCENARIO)
    assert len(table) > STEPS
    compared = 0
    for name in wanted[0]:
        unit, _, port = name.partition(".")
        column = next((c for t in TYPES if (c := f"{unit}::{port}[{t}]") in table[0]), None)
        if column is None:  # an enumeration
            continue
        theirs, ours = [float(row[column]) for row in table[: STEPS + 1]], [row[name] for row in wanted]
        np.testing.assert_allclose(theirs, ours, rtol=0, atol=1e-6, err_msg=name)
        compared += len(set(ours)) > STEPS // 2
    assert compared > 10
