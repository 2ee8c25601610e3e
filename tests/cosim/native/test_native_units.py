"""The native test units are valid FMUs of both standards; what they compute is compared wherever they are used."""

import pytest
from support.cosim.native_units import declarations, native_fmu
from support.fmus.validity import problems_of

HARM_HERE = ("_in_load", "_in_unload", "_in_instantiate", "_in_free")
"""Ends of the names of units that would harm this process, as the validation loads and instantiates them."""


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_all_units_are_valid(fmi: int):
    known = [d.name for d in declarations().values() if fmi == 3 or not d.needs_fmi3]
    problems = {name: problems_of(native_fmu(name, fmi)) for name in known if not name.endswith(HARM_HERE)}
    assert {name: found for name, found in problems.items() if found} == {}
    assert len(problems) > 20
