"""Units of one library share its functions as long as one of them has it loaded, and no longer."""

from pathlib import Path
from typing import Any

import pytest
from native_units import native_fmu

from handover.cosim.fmu.file.description import FmuDescription, describe_fmu
from handover.cosim.fmu.file.fmpy_edge import unpack
from handover.cosim.fmu.loading import load_unit


def loaded(d: FmuDescription, folder: Path) -> Any:
    def log(_status: int, _message: str) -> None:
        pass

    return load_unit(d, folder, "unit", log, lambda _call: None)


@pytest.mark.parametrize("fmi", [2, 3])
def test_functions_are_shared_until_the_library_is_unloaded(fmi: int, tmp_path: Path):
    d = describe_fmu(native_fmu("gain", fmi))
    unpack(d.path, tmp_path, d.fmi, d.identifier)
    first, second = loaded(d, tmp_path), loaded(d, tmp_path)
    shared = first.dll
    assert second.dll is shared
    first.freeInstance()
    third = loaded(d, tmp_path)
    assert third.dll is shared
    for unit in (second, third):
        unit.freeInstance()
    last = loaded(d, tmp_path)
    assert last.dll is not shared
    last.freeInstance()
