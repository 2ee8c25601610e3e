"""What the site looks up is there: every public name, and a page for every unit and scenario."""

import importlib.util
import sys
from types import ModuleType

import pytest
from support.documentation import ROOT

import handover
from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import SCENARIOS, SYSTEMS


def test_every_public_name_is_in_the_reference():
    reference = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert [name for name in handover.__all__ if f":: handover.{name}\n" not in reference] == []


@pytest.fixture
def declared_pages(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.setattr(sys, "path", [str(ROOT / "docs"), *sys.path])
    spec = importlib.util.spec_from_file_location("declared_pages", ROOT / "docs" / "declared_pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_pages_of_units_and_scenarios_have_what_these_declare(declared_pages: ModuleType):
    for entry in UNITS.values():
        facts = declared_pages.unit(entry)
        assert {r.name for r, _ in facts["parameters"]} == {v.name for v in facts["declared"].parameters}
    for system in SYSTEMS:
        for name in system.scenarios:
            parameters = declared_pages.scenario(SCENARIOS[name], system)["parameters"]
            assert [r.name for r, _ in parameters] == [v.name for v in SCENARIOS[name].parameters()]
    origins = {r.name: origin for r, origin in declared_pages.unit(UNITS["Thrusters"])["parameters"]}
    assert origins["f_max"].startswith("stated: ")
