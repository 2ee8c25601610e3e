"""`handover new unit --for SCENARIO:PLACE`: a start with the ports of a place."""

from pathlib import Path

import numpy as np
import pytest

import handover
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Causality, Kind
from handover.fmus.catalog import find_unit, import_class
from handover.scenarios.catalog import SCENARIOS, named_scenario
from handover.scenarios.cli.units.place_start import start_for
from handover.scenarios.experiment.places import ports_of_place


def has_start(scenario: str, place: str) -> bool:
    experiment = named_scenario(scenario)
    ports = ports_of_place(experiment.places[place], find_unit(experiment.units[place]))
    kinds = {p.declared.kind for p in ports if p.is_required and p.declared.causality is Causality.OUTPUT}
    return kinds <= {Kind.REAL, Kind.INTEGER, Kind.BOOLEAN, Kind.ENUMERATION}


OF_UNITS = {
    unit: f"{name}:{place}"
    for name in SCENARIOS
    for place, unit in named_scenario(name).units.items()
    if has_start(name, place)
}
"""A place of each shipped unit for which there can be a start."""
FAST = ("ir_grasp:reflex", "flyer_impedance:robot", "helix_handover:servo")
SLOW = ("helix_handover:vision", "vsl_hybrid:planner", "flyer_robot_to_human:person", "flyer_robot_to_human:decision")


def tier(taken: str) -> tuple[pytest.MarkDecorator, ...]:
    return () if taken in FAST else (pytest.mark.slow,)


@pytest.mark.parametrize("taken", [pytest.param(p, marks=tier(p)) for p in sorted({*OF_UNITS.values(), *FAST})])
def test_each_place_has_a_start_that_declares_its_ports_as_the_shipped_unit_does(
    taken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    scenario, _, place = taken.partition(":")
    module = f"start_{scenario}_{place}"
    (tmp_path / f"{module}.py").write_text(start_for(taken, "Mine", module)[f"{module}.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    found = {v.name: v for v in describe(import_class(f"{module}:Mine")).variables}
    experiment = named_scenario(scenario)
    for p in ports_of_place(experiment.places[place], find_unit(experiment.units[place])):
        v = p.declared
        if p.is_required or v.causality is Causality.INPUT or v.name in experiment.places[place].advised:
            assert (found[v.name].kind, found[v.name].shape, found[v.name].unit) == (v.kind, v.shape, v.unit)
            assert found[v.name].items == v.items
        else:
            assert v.name not in found


@pytest.mark.parametrize("taken", [FAST[0], *(pytest.param(p, marks=pytest.mark.slow) for p in SLOW)])
def test_the_start_of_each_place_runs(taken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    scenario, _, place = taken.partition(":")
    module = f"running_{scenario}_{place}"
    (tmp_path / f"{module}.py").write_text(start_for(taken, "Mine", module)[f"{module}.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with handover.open(scenario, units={place: f"{module}:Mine"}) as running:
        running.step(0.1)
        assert not running.outcome.reason.startswith("not judged")
        for output in (o for o in running.outputs if o.startswith(f"{place}.q_W")):
            np.testing.assert_allclose(np.linalg.norm(running[output]), 1.0, atol=1e-5)
