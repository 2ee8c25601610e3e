from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.loading import load_unit


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_log_line_goes_to_the_unit_that_wrote_it_however_many_are_loaded(
    fmu: Callable[..., Path], fmi: int, tmp_path: Path
):
    d = describe_fmu(fmu("Mass", fmi))
    unpack(d.path, tmp_path, d.fmi, d.identifier)
    logs: list[list[str]] = [[], []]

    def loaded(log: list[str]) -> Any:
        def take(_status: int, message: str) -> None:
            log.append(message)

        return load_unit(d, tmp_path, "mass", take, lambda _what: None)

    units = [loaded(log) for log in logs]
    with pytest.raises(FMICallException):
        units[0].doStep(0.0, 0.1)
    assert any("DoStep" in line for line in logs[0])
    assert logs[1] == []
    for unit in units:
        unit.freeInstance()
