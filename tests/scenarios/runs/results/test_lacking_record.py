"""A controller with fewer outputs than the scenario's own leaves out what shows them, with a line, and nothing else."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.kept_runs import copied_run, kept_run
from support.scenarios.flyer_runs import run
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.cosim.record.reader import Record
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.robots.free_flyer.parameters import ImpedanceParameters
from handover.scenarios.robots.free_flyer.push.impedance import FlyerImpedance
from handover.scenarios.runs.reporting.run_figures import draw_figures
from handover.scenarios.runs.reporting.run_page import write_run_page
from handover.scenarios.runs.results import run_facts
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

LACKING = {
    "ir_grasp": ("reflex", "Wrist along x of W", "measured", "palm"),
    "helix_handover": ("servo", "Tendon forces", "segment 1, 0°", "arm"),
    "vsl_hybrid": ("planner", "Servos' currents", "J1", "arm"),
    "flyer_robot_to_human": ("decision", "Roll of gripper, hand and object in W", "hand", "robot"),
    "flyer_impedance": ("impedance", "Force of the thrusters along x of B", "given", "robot"),
}
"""The unit whose outputs are taken away, a plot and its curve that stay, and a body that stays."""


def lacking(name: str, folder: Path) -> Path:
    """Return a copy of a short run whose controller has recorded nothing."""
    copied_run(folder, "run", name, "--no-report", "--stop", "0.5")
    select_columns(folder / "signals.parquet", folder / "signals.parquet", without=f"{LACKING[name][0]}.")
    return folder


def select_columns(source: Path, target: Path, without: str) -> None:
    table = pq.read_table(source)
    pq.write_table(table.select([c for c in table.column_names if not c.startswith(without)]), target)


@pytest.mark.parametrize(
    "name", [n if n == "flyer_impedance" else pytest.param(n, marks=pytest.mark.slow) for n in LACKING]
)
def test_what_needs_no_output_of_the_controller_is_drawn_in_its_colours(name: str, tmp_path: Path):
    unit, title, label, body = LACKING[name]
    folder, experiment = lacking(name, tmp_path / "r"), SCENARIOS[name]()
    parameters = parse_parameters(SCENARIOS[name], [])
    record = LackingRecord(Record(folder / "signals.parquet"), experiment.units)
    plots = {p.title: p for p in record.drawable_plots(experiment.plots(parameters, record))}
    assert label in [c.label for c in plots[title].curves]
    assert all(np.isfinite(c.values).any() for p in plots.values() for c in p.curves)
    replay = experiment.replay(parameters, record)
    assert replay is not None
    shown = record.drawable_replay(replay)
    assert shown is not None
    assert body in [d.label for d in (*shown.bodies, *shown.lines)]
    (line,) = record.lines
    assert f"{unit}." in line


def test_page_and_figures_say_in_a_line_what_is_left_out(tmp_path: Path, sketches: Sketches):
    unit, title, *_ = LACKING["flyer_impedance"]
    run_folder = RunFolder.of_run(lacking("flyer_impedance", tmp_path / "r"))
    (line,) = write_run_page(run_folder)
    assert line.startswith(f"what is drawn from {unit}.")
    page = run_folder.report.read_text(encoding="utf-8")
    assert page.count("Left out: ") == 1
    assert title.replace("'", "&#39;") in page
    assert all(f'id="{anchor}"' in page for anchor in ("time", "replay", "signals"))
    faults, parameters, record = ToleratedFaults(), ImpedanceParameters(), Record(tmp_path / "r" / "signals.parquet")
    draw_figures(FlyerImpedance(), parameters, FlyerImpedance().evaluator(parameters), record, tmp_path, faults)
    assert [said for said in faults.lines if "what is drawn from" in said]
    assert sketches


def test_curves_keep_their_colours_where_others_are_left_out(tmp_path: Path):
    signals = kept_run("run", "flyer_impedance", "--no-report", "--stop", "0.5") / "signals.parquet"
    whole = Record(signals)
    select_columns(signals, tmp_path / "less.parquet", without="thrusters.")
    record = LackingRecord(Record(tmp_path / "less.parquet"), FlyerImpedance.units)
    parameters = ImpedanceParameters()
    before = {p.title: p for p in FlyerImpedance().plots(parameters, whole)}
    after = record.drawable_plots(FlyerImpedance().plots(parameters, record))
    assert record.lacking == ["thrusters.f_B", "thrusters.tau_B"]
    for plot in after:
        colours = dict(zip((c.label for c in before[plot.title].curves), before[plot.title].colours, strict=True))
        assert [colours[c.label] for c in plot.curves] == list(plot.colours)
    assert [c.label for p in after if p.title.startswith("Force") for c in p.curves] == ["commanded"] * 3


def test_what_a_units_outputs_would_have_been_is_known_and_a_signal_that_none_has_is_an_error(tmp_path: Path):
    pq.write_table(pa.Table.from_pydict({"time": [0.0]}), tmp_path / "one.parquet")
    own = {"own": "handover.plants.free_flyer.robot.free_flyer:FreeFlyer", "none": "nowhere:Block"}
    record = LackingRecord(Record(tmp_path / "one.parquet"), {**FlyerImpedance.units, **own})
    for signal in ("robot.speed_of_light", "nobody.p_WB", "none.q_WB"):
        with pytest.raises(KeyError, match=signal):
            record[signal]
    assert record["robot.p_WB"].shape == (1, 3)
    assert record["own.q_WB"].shape == (1, 4)
    assert record.lacking == ["robot.p_WB", "own.q_WB"]


LEFT = ("time_figures", "draw", "replay", "published")
BARE: Any = type("Bare", (FlyerImpedance,), {"name": "bare", **{name: vars(Experiment)[name] for name in LEFT}})
"""A scenario of somebody else's with neither plots nor figures, replay nor published values."""


def test_a_scenario_without_plots_and_replay_has_a_page_without_these_sections(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def bare(_name: str, _source: Any) -> Any:
        return BARE

    monkeypatch.setattr(run_facts, "scenario_of", bare)
    ended = run(BARE, tmp_path / "r", drawn=True, stop=0.5)
    assert ended.left_out == ()
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "Left out" not in page
    assert all(f'id="{anchor}"' in page for anchor in ("signals", "graph", "parameters", "files"))
    assert not any(f'id="{anchor}"' in page for anchor in ("time", "replay", "published", "pictures"))
    assert list((tmp_path / "r" / "figures").iterdir()) == []
