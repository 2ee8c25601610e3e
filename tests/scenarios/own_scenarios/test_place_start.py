"""`handover new unit --for SCENARIO:PLACE`: a start with the ports of a place."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tutorial import refused, succeeded

import handover
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.variable import Causality, Kind
from handover.fmus.catalog import find_unit, import_class
from handover.scenarios.catalog import SCENARIOS, named_scenario
from handover.scenarios.cli.command import main
from handover.scenarios.cli.units.place_start import start_for
from handover.scenarios.experiment.places import ports_of_place


def has_start(scenario: str, place: str) -> bool:
    experiment = named_scenario(scenario)
    ports = ports_of_place(experiment.places[place], find_unit(experiment.units[place]))
    kinds = {p.declared.kind for p in ports if p.is_required and p.declared.causality is Causality.OUTPUT}
    return kinds <= {Kind.REAL, Kind.INTEGER, Kind.BOOLEAN, Kind.ENUMERATION}


PLACES = [(name, place) for name in SCENARIOS for place in named_scenario(name).places if has_start(name, place)]


@pytest.mark.parametrize(("scenario", "place"), PLACES, ids=[":".join(p) for p in PLACES])
def test_each_place_has_a_start_that_declares_its_ports_as_the_shipped_unit_does(
    scenario: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    module = f"start_{scenario}_{place}"
    (tmp_path / f"{module}.py").write_text(start_for(f"{scenario}:{place}", "Mine", module)[f"{module}.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    found = {v.name: v for v in describe(import_class(f"{module}:Mine")).variables}
    experiment = named_scenario(scenario)
    for p in ports_of_place(experiment.places[place], find_unit(experiment.units[place])):
        v = p.declared
        if p.is_required or v.causality is Causality.INPUT:
            assert (found[v.name].kind, found[v.name].shape, found[v.name].unit) == (v.kind, v.shape, v.unit)
            assert found[v.name].items == v.items
        else:
            assert v.name not in found


_FAST = ("ir_grasp:reflex", "vsl_hybrid:arm", "flyer_impedance:robot", "flyer_robot_to_human:decision")
_RUN = [f"{name}:{place}" for name, place in PLACES if name in ("helix_handover", "vsl_hybrid", "flyer_robot_to_human")]
_SLOW = [pytest.param(p, marks=pytest.mark.slow) for p in (*_RUN, "ir_grasp:scene") if p not in _FAST]


@pytest.mark.parametrize("taken", [*_FAST, *_SLOW])
def test_the_start_of_each_place_runs(taken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    scenario, _, place = taken.partition(":")
    module = f"running_{scenario}_{place}"
    (tmp_path / f"{module}.py").write_text(start_for(taken, "Mine", module)[f"{module}.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    with handover.open(scenario, units={place: f"{module}:Mine"}) as running:
        running.step(0.2)
        assert not running.outcome.reason.startswith("not judged")
        for output in (o for o in running.outputs if o.startswith(f"{place}.q_W")):
            np.testing.assert_allclose(np.linalg.norm(running[output]), 1.0, atol=1e-5)


@pytest.mark.parametrize("there", [True, False])
def test_how_to_run_its_test_is_told_also_without_pytest(there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def find_spec(name: str) -> bool | None:
        return there if name == "pytest" else None

    monkeypatch.setattr("handover.scenarios.cli.units.new.find_spec", find_spec)
    told = CliRunner().invoke(main, ["new", "controller", "Quick", "--out", str(tmp_path)]).stderr
    assert ("its test: python -m pytest test_quick.py" in told) is there
    assert ("its test: python -m pip install pytest, then python -m pytest test_quick.py" in told) is not there


@pytest.mark.slow
def test_the_start_passes_its_test_and_runs(tmp_path: Path):
    printed = succeeded(tmp_path, "new", "controller", "Gentle", "--for", "helix_handover:servo")
    assert "gentle.py" in printed
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", "test_gentle.py"], cwd=tmp_path, check=False)
    assert done.returncode == 0


def test_a_place_that_is_not_there_is_told_and_nothing_written(tmp_path: Path):
    for place, told in (
        ("helix_handover", "not of the form SCENARIO:PLACE"),
        ("helix_handover:servos", "did you mean servo?"),
        ("helix_handovers:servo", "did you mean helix_handover or"),
        ("helix_handover:camera", "left, right: no start can be written"),
    ):
        assert told in refused(tmp_path, "new", "controller", "Gentle", "--for", place)
    assert "--for is for a unit or a controller" in refused(
        tmp_path, "new", "scenario", "Gentle", "--for", "helix_handover:servo"
    )
    assert not list(tmp_path.iterdir())
