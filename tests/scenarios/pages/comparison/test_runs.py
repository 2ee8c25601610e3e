"""Runs beside each other: the same curves over one time, metrics in one table, and what cannot be compared."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.kept_runs import kept_run

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, TimePlot
from handover.scenarios.pages.comparison.entries import NotComparable, RunEntry, differences_of, read_entries
from handover.scenarios.pages.comparison.runs import Overlay, at_times, metric_rows, overlaid
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp


def run(path: Path, time: Sequence[float], signals: Mapping[str, tuple[str, Any]], **more: Any) -> Path:
    """Write the folder of a run of a system from elsewhere, with signals given by unit and values."""
    path.mkdir()
    metrics = more.pop("metrics", {})
    content = {"scenario": "spring", "source": {"ssp": "spring.ssp"}, "parameters": {}, "seed": 0, **more}
    (path / "run.json").write_text(json.dumps(content))
    summary = {"success": True, "reason": "it ended", "metrics": metrics}
    (path / "summary.json").write_text(json.dumps(summary))
    fields: list[Any] = [pa.field("time", pa.float64(), metadata={"unit": "s"})]
    arrays: dict[str, Any] = {n: pa.array(values) for n, (_, values) in signals.items()}
    fields += [pa.field(n, arrays[n].type, metadata={"unit": unit}) for n, (unit, _) in signals.items()]
    columns: dict[str, Any] = {"time": list(time), **arrays}
    table: Any = pa.Table.from_pydict(columns, schema=pa.schema(fields))
    pq.write_table(table, path / "signals.parquet")
    return path


def runs(*folders: Path) -> Sequence[RunEntry]:
    campaigns, entries = read_entries(folders)
    assert not campaigns
    return entries


def values_of(overlay: Overlay) -> dict[str, dict[str, list[float]]]:
    return {p.title: {c.label: c.values.tolist() for c in p.curves} for p in overlay.plots}


def test_curves_of_runs_with_other_steps_lie_over_one_time(tmp_path: Path):
    first = run(tmp_path / "a", [0.0, 1.0, 2.0], {"mass.x": ("m", [0.0, 10.0, 40.0])})
    second = run(tmp_path / "b", [0.0, 0.5, 1.0], {"mass.x": ("m", [5.0, 6.0, 8.0])})
    overlay = overlaid(runs(first, second), ["mass.x"])
    assert overlay.time.tolist() == [0.0, 0.5, 1.0, 2.0]
    assert values_of(overlay) == {
        "mass.x": {"a": [0.0, 5.0, 10.0, 40.0], "b": [5.0, 6.0, 8.0, pytest.approx(np.nan, nan_ok=True)]}
    }
    assert overlay.plots[0].axis_label == "mass.x (m)"


def test_small_values_are_in_a_smaller_unit_and_elements_in_plots_of_their_own(tmp_path: Path):
    signals = {"arm.p[1]": ("m", [0.0, 0.1]), "arm.p[2]": ("m", [0.2, 0.3])}
    entries = runs(run(tmp_path / "a", [0.0, 1.0], signals), run(tmp_path / "b", [0.0, 1.0], signals))
    both = overlaid(entries, ["arm.p"])
    assert [(p.title, p.axis_label) for p in both.plots] == [
        ("arm.p[1]", "arm.p[1] (mm)"),
        ("arm.p[2]", "arm.p[2] (mm)"),
    ]
    assert values_of(overlaid(entries, ["arm.p[2]"])) == {"arm.p[2]": {"a": [200.0, 300.0], "b": [200.0, 300.0]}}


def test_a_held_value_stays_until_it_changes_and_gaps_stay_gaps():
    own, time = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.5, 1.0, 1.5, 2.5, 3.0, 4.0])
    values = np.array([1.0, 3.0, np.nan, 7.0])
    nan = np.nan
    held = at_times(Curve(label="", values=values, held=True), own, time)
    np.testing.assert_array_equal(held, [1.0, 1.0, 3.0, 3.0, nan, 7.0, nan])
    lines = at_times(Curve(label="", values=values), own, time)
    np.testing.assert_array_equal(lines, [1.0, 2.0, 3.0, nan, nan, 7.0, nan])


def test_a_curve_that_lies_on_another_is_dashed(tmp_path: Path):
    time = np.linspace(0.0, 1.0, 20)
    first = run(tmp_path / "a", time.tolist(), {"mass.x": ("m", time.tolist()), "mass.v": ("m/s", [1.0] * 20)})
    second = run(tmp_path / "b", time.tolist(), {"mass.x": ("m", time.tolist()), "mass.v": ("m/s", [3.0] * 20)})
    third = run(tmp_path / "c", time.tolist(), {"mass.x": ("m", (5 - time).tolist()), "mass.v": ("m/s", [2.0] * 20)})
    plots = overlaid(runs(first, second, third)).plots
    assert [[c.stroke for c in p.curves] for p in plots] == [["solid", "dashed", "solid"]] * 2


def test_a_signal_that_one_run_lacks_is_drawn_of_the_others_and_reported(tmp_path: Path):
    first = run(tmp_path / "a", [0.0, 1.0], {"mass.x": ("m", [0.0, 1.0]), "mass.v": ("m/s", [0.0, 1.0])})
    second = run(tmp_path / "b", [0.0, 1.0], {"mass.x": ("m", [0.0, 2.0])})
    overlay = overlaid(runs(first, second), ["mass.v", "mass.x"])
    assert [[c.label for c in p.curves] for p in overlay.plots] == [["a"], ["a", "b"]]
    assert [p.colours for p in overlay.plots] == [(0,), (0, 1)]
    assert overlay.left_out == ["b has no signal mass.v"]


class Limited(IrGrasp):
    """A scenario whose plot has limits that follow from a run's own curve, and a long label."""

    def plots(self, parameters: Any, record: Record) -> Sequence[TimePlot]:  # noqa: ARG002
        top = float(record["mass.x"].max())
        curve = Curve(label="tip by the servos, links taken as rigid", values=record["mass.x"])
        other = Curve(label="dashed", values=record["mass.x"], stroke="dashed")
        more = Curve(label="tip", values=record["mass.x"])
        return [TimePlot(title="Tip", quantity="x", unit="m", curves=[curve, other, more], limits=(0.0, top))]


def test_axes_have_room_for_all_runs_and_lines_for_long_labels(tmp_path: Path):
    first = run(tmp_path / "a", [0.0, 1.0], {"mass.x": ("m", [0.0, 1.0])})
    second = run(tmp_path / "b", [0.0, 1.0], {"mass.x": ("m", [0.0, 5.0])})
    entries = [replace(e, facts=replace(e.facts, experiment=Limited())) for e in runs(first, second)]
    plots = overlaid(entries).plots
    assert [p.title for p in plots] == ["Tip: tip by the servos, links taken as rigid", "Tip: tip"]
    assert [p.limits for p in plots] == [(0.0, 5.0)] * 2
    assert [p.axis_label for p in plots] == ["x, tip by the\nservos, links\ntaken as rigid (m)", "x, tip (m)"]


def test_a_curve_that_a_unit_does_not_give_is_left_out_of_that_run_alone(grasp_without_reflex: Path):
    grasp = kept_run("run", "ir_grasp", "--no-report")
    overlay = overlaid(runs(grasp, grasp_without_reflex))
    drawn = {p.title: [c.label for c in p.curves] for p in overlay.plots}
    assert drawn["Distances of the fingers from the object: thumb, as seen"] == [grasp.name]
    assert drawn["Wrist along x of W"] == [grasp.name, grasp_without_reflex.name]
    (line,) = overlay.left_out
    assert line.startswith(f"{grasp_without_reflex.name} lacks what is drawn from reflex.")


def test_a_run_without_a_record_is_reported(tmp_path: Path):
    first = run(tmp_path / "a", [0.0, 1.0], {"mass.x": ("m", [0.0, 1.0])})
    second = run(tmp_path / "b", [0.0, 1.0], {"mass.x": ("m", [0.0, 1.0])})
    (second / "signals.parquet").unlink()
    overlay = overlaid(runs(first, second))
    assert [c.label for c in overlay.plots[0].curves] == ["a"]
    assert overlay.left_out == ["b has no curves: its record is missing, or has less than two rows"]


def test_signals_that_cannot_be_drawn_are_refused_all_at_once(tmp_path: Path):
    many = {f"arm.q[{k}]": ("rad", [0.0, 1.0]) for k in range(1, 12)}
    first = run(tmp_path / "a", [0.0, 1.0], {"mass.x": ("m", [0.0, 1.0]), **many})
    second = run(tmp_path / "b", [0.0, 1.0], {"mass.x": ("rad", [0.0, 2.0])})
    with pytest.raises(NotComparable) as raised:
        overlaid(runs(first, second), ["mass.y", "mass.x", "arm.q", "arm.q[12]"])
    assert raised.value.faults == (
        "no run has a signal 'mass.y'; did you mean mass.x?",
        "signal mass.x is in m and in rad: it cannot be drawn along one axis",
        "signal arm.q has 11 elements; name some of them, such as arm.q[1]",
        "no run has a signal 'arm.q[12]'; did you mean arm.q?",
    )


def test_metrics_stand_beside_each_other(tmp_path: Path):
    def metric(value: float | None, unit: str = "m", description: str = "gap") -> dict[str, Any]:
        return {"value": value, "unit": unit, "description": description}

    first = run(
        tmp_path / "a", [0.0, 1.0], {}, metrics={"x": metric(0.1), "gap": metric(0.2, description="gap (left)")}
    )
    second = run(tmp_path / "b", [0.0, 1.0], {}, metrics={"gap": metric(None)}, headline=["gap"])
    rows = metric_rows(runs(first, second))
    assert [(r.name, r.description) for r in rows] == [("gap", "gap"), ("x", "gap")]
    np.testing.assert_array_equal([[*r.values.values()] for r in rows], [[0.2, np.nan], [0.1, np.nan]])
    third = run(tmp_path / "c", [0.0, 1.0], {}, metrics={"x": metric(1.0, "s")})
    with pytest.raises(NotComparable, match=f"{third}: its metric x is in s, not in m"):
        metric_rows(runs(first, second, third))


@pytest.mark.parametrize(
    ("descriptions", "common"),
    [
        (("why: 1 is patience", "why: 5 is blind"), "why: 1 is patience; 5 is blind"),
        (("cost: of three", "cost: of three (sees nothing)"), "cost: of three"),
        (("why", "why: 1 is patience"), "why"),
        (("why: 1 is patience", "how"), "stop"),
    ],
)
def test_what_a_metric_is_in_one_run_is_left_out_or_listed(descriptions: tuple[str, str], common: str, tmp_path: Path):
    metrics = [{"stop": {"value": 1, "unit": "1", "description": text}} for text in descriptions]
    stopped = [run(tmp_path / f"{k}", [0.0, 1.0], {}, metrics=of_run) for k, of_run in enumerate(metrics)]
    assert metric_rows(runs(*stopped))[0].description == common


def test_parameters_units_and_versions_that_differ_are_listed(tmp_path: Path):
    units = {"mass": {"fmu": "mass.fmu", "sha256": "1" * 64}}
    first = run(tmp_path / "a", [0.0, 1.0], {}, parameters={"k": 2.0, "m": 1.0}, units=units, versions={"numpy": "2.0"})
    second = run(tmp_path / "b", [0.0, 1.0], {}, parameters={"k": 3.0, "m": 1.0}, versions={"numpy": "2.0"})
    assert [(d.kind, d.name, *d.values) for d in differences_of(runs(first, second))] == [
        ("parameter", "k", "2", "3"),
        ("unit", "mass", "mass.fmu (111111111111)", "–"),
    ]


def test_other_times_and_inputs_of_runs_are_listed(tmp_path: Path):
    def source(step: str, digest: str) -> dict[str, str]:
        return {"fmu": "x.fmu", "step": step, "input": "/in/u.csv", "input_sha256": digest * 64}

    first = run(tmp_path / "a", [0.0, 1.0], {}, source=source("1/100", "1"), experiment={"start": 0.0, "stop": 1.0})
    second = run(tmp_path / "b", [0.0, 1.0], {}, source=source("1/10", "2"), experiment={"start": 0.0, "stop": 2.0})
    assert [(d.kind, d.name, *d.values) for d in differences_of(runs(first, second))] == [
        ("times", "stop time", "1 s", "2 s"),
        ("times", "communication step", "0.01 s", "0.1 s"),
        ("file", "inputs", "u.csv (111111111111)", "u.csv (222222222222)"),
    ]
