"""What foreign hosts are compared with shows that parameters and inputs act."""

import pytest
from reference import FMI2_UNITS, References, description

from handover.fmus.catalog import UNITS

LIGHT = "HandoverPartner"
CASES = [(n, fmi) for fmi in (2, 3) for n in (UNITS if fmi == 3 else FMI2_UNITS)]


@pytest.mark.parametrize(
    ("unit", "fmi"), [c if c[0] == LIGHT else pytest.param(*c, marks=pytest.mark.slow) for c in CASES]
)
def test_outputs_differ_from_those_of_a_unit_that_is_left_alone(references: References, unit: str, fmi: int):
    varying, held, untouched = (f(unit, fmi) for f in (references.varying, references.held, references.untouched))
    assert not varying.is_like(untouched)
    assert not held.is_like(untouched)
    assert varying.is_like(held) is not bool(description(unit).inputs)
