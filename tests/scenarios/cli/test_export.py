import re
import zipfile
from fractions import Fraction
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.commands import call
from support.rewritten_archive import described_otherwise

from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.parameters import parse_parameters

CHEAP, SLOW = "ir_grasp", ("helix_handover", "vsl_hybrid")
STOPS = {"ir_grasp": Fraction(1, 2), "helix_handover": Fraction(3, 10)}
"""Shortened; long enough for every unit to step several times and for signals to change."""


def recorded(system: System, stop: Fraction, path: Path) -> "pa.Table":
    with Master(system) as master, Recorder(path) as recorder:
        master.run(stop, [recorder])
    return pq.read_table(path)


def tier(name: str) -> tuple[pytest.MarkDecorator, ...]:
    return () if name == CHEAP else (pytest.mark.slow if name in SLOW else pytest.mark.platforms,)


@pytest.mark.parametrize("name", [pytest.param(name, marks=tier(name)) for name in SCENARIOS])
def test_an_exported_scenario_gives_the_same_signals_as_the_scenario(name: str, tmp_path: Path):
    scenario, stop = SCENARIOS[name], STOPS.get(name, Fraction(1))
    parameters = parse_parameters(scenario, [])
    system = scenario().build(parameters, 3, lambda unit: cached(scenario.units[unit], 3))
    wanted = recorded(system, stop, tmp_path / "wanted.parquet")
    file = tmp_path / "exported.ssp"
    result = call("export", name, "--ssp", file, "--seed", "3")
    assert result.exit_code == 0, result.output
    with SspFile(file) as ssp:
        assert ssp.stop == scenario().stop_time(parameters)
        assert {u.description.fmi for u in ssp.system.units.values()} <= {2, 3}
        found = recorded(ssp.system, stop, tmp_path / "found.parquet")
    assert found.num_rows > 3
    assert sum(len(set(column.to_pylist())) > 2 for column in found.columns) > 3
    assert found.column_names == wanted.column_names
    for column in wanted.column_names:
        assert found[column].equals(wanted[column]), column


def test_enumerations_are_start_values_of_the_units_and_are_bound_nowhere(tmp_path: Path):
    file = tmp_path / "a.ssp"
    result = call("export", CHEAP, "--ssp", file, "-p", "strategy=forward")
    assert (result.exit_code, result.stderr) == (0, "building units ...\n")
    with zipfile.ZipFile(file) as archive:
        assert not [n for n in archive.namelist() if b"Enumeration" in archive.read(n) and n.endswith(".ssv")]
    with SspFile(file) as ssp:
        reflex, scene = ssp.system.units["reflex"], ssp.system.units["scene"]
    assert "strategy" not in reflex.start
    assert reflex.start
    strategy = reflex.description.parameters["strategy"]
    usual = describe_fmu(cached("IrReflex", 2))
    assert dict(strategy.items)["FORWARD"] == int(str(strategy.start)) != int(str(usual.parameters["strategy"].start))
    assert reflex.description.token != usual.token
    assert scene.description.token == describe_fmu(cached("GraspScene", 2)).token


def test_what_is_presumed_of_a_system_is_said(tmp_path: Path):
    other, file = tmp_path / "push.fmu", tmp_path / "a.ssp"
    described_otherwise(cached("Push", 2), other, lambda text: re.sub("<DefaultExperiment[^>]*/>", "", text))
    result = call("export", "flyer_impedance", "--ssp", file, "--unit", f"push={other}")
    assert result.exit_code == 0, result.output
    assert "push: its FMU proposes no communication step; 0.016 s is taken" in result.stderr


def test_parameters_and_other_units_are_exported(tmp_path: Path):
    other = tmp_path / "Other.fmu"
    other.write_bytes(cached("IrReflex", 3, scalar=True).read_bytes())
    file = tmp_path / "new" / "a.ssp"
    result = call("export", CHEAP, "--ssp", file, "-p", "strategy=forward", "--unit", f"reflex={other}")
    assert result.exit_code == 0, result.output
    reported = "reflex.strategy: bound as an enumeration, which libcosim and Ecos do not take"
    assert (result.stdout, result.stderr) == (f"{file}\n", f"building units ...\n{reported}\n")
    with SspFile(file) as ssp:
        units = ssp.system.units
        assert (units["scene"].description.fmi, units["reflex"].description.fmi) == (2, 3)
        assert units["reflex"].description.path.name == "Other.fmu"
        assert units["reflex"].start["strategy"] == "FORWARD"
