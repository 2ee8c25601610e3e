"""Units in Ecos' command line. The others in it are rows of docs/hosts.md (`make hosts`)."""

import importlib.util
from fractions import Fraction
from pathlib import Path

import pytest
from ecos_command import Ecos
from reference import References, expect_same, variables

from handover.cosim.blocks.variable import Kind
from handover.fmus import interpreter
from handover.fmus.build import build_block, cached

pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("ecospy") is None, reason="ecospy has wheels for few platforms"),
    pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that Ecos can load"),
]

LIGHT = ("HandoverPartner", "Thrusters")


@pytest.fixture(scope="module")
def ecos(tmp_path_factory: pytest.TempPathFactory) -> Ecos:
    return Ecos(tmp_path_factory.mktemp("ecos"))


@pytest.fixture(scope="module")
def notary(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an FMI 2 unit beside units of both standards: of FMI 3, Ecos 0.7 gets every text empty."""
    return build_block("notary:Notary", 2, tmp_path_factory.mktemp("notary"), step=Fraction(1, 50))


@pytest.mark.parametrize("unit", LIGHT)
def test_fmi2_gives_the_same(references: References, ecos: Ecos, notary: Path, unit: str, tmp_path: Path):
    found = ecos.outputs(tmp_path, unit, cached(unit, 2), notary)
    expect_same(found, references.varying(unit, 2).without(enumerations(unit)))


@pytest.mark.parametrize("unit", LIGHT[:1])
def test_scalar_fmi3_gives_the_same(references: References, ecos: Ecos, notary: Path, unit: str, tmp_path: Path):
    found = ecos.outputs(tmp_path, unit, cached(unit, 3, scalar=True), notary)
    expect_same(found, references.varying(unit, 3).without(enumerations(unit)))


def test_arrays_shift_what_ecos_reads(ecos: Ecos, tmp_path: Path):
    """This is why there is a scalar form; if it fails, Ecos has learnt arrays and the README may say so."""
    last = [
        ecos.simulate(tmp_path, fmu, 0.016, 0.5)[-1] for fmu in (cached(LIGHT[1], 3), cached(LIGHT[1], 3, scalar=True))
    ]
    assert all(float(cells["time"]) > 0.4 for cells in last)
    whole, scalar = (float(cells["instance::time[REAL]"]) for cells in last)
    assert scalar == float(last[1]["time"])
    assert whole != float(last[0]["time"])


def enumerations(unit: str) -> list[str]:
    """Return the names of a unit's enumerations, which Ecos leaves out of both standards."""
    return [name for name, v in variables(unit).items() if v.kind is Kind.ENUMERATION]
