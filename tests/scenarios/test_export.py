from fractions import Fraction
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from cosim.master import Master
from cosim.recorder import Recorder
from cosim.ssp.ssp_file import SspFile
from cosim.system import System
from fmus.build import cached
from scenarios.catalog import SCENARIOS
from scenarios.command import main
from scenarios.parameters import parse_parameters

CHEAP = "ir_grasp"
STOPS = {"ir_grasp": Fraction(1), "helix_handover": Fraction(3, 10)}
"""Shortened; long enough for every unit to step several times and for signals to change."""


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def recorded(system: System, stop: Fraction, path: Path) -> "pq.Table":
    with Master(system) as master, Recorder(path) as recorder:
        master.run(stop, [recorder])
    return pq.read_table(path)


@pytest.mark.parametrize("name", [n if n == CHEAP else pytest.param(n, marks=pytest.mark.slow) for n in SCENARIOS])
def test_an_exported_scenario_gives_the_same_signals_as_the_scenario(name: str, tmp_path: Path):
    scenario, stop = SCENARIOS[name], STOPS.get(name, Fraction(2))
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
