"""What scenarios give to be drawn over time, from real runs: what it is, in its unit, however short the record is."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib.axes import Axes
from support.kept_runs import kept_run

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.experiment.plotting import draw_time_figures, draw_time_plot
from handover.scenarios.experiment.time_plot import COLOURS, Curve, TimePlot
from handover.scenarios.runs.reporting.time_plots import time_figure

SCENES = ("ir_grasp", "flyer_impedance", "vsl_hybrid")


class Run:
    """A run, with what it was asked for and what it left."""

    def __init__(self, name: str) -> None:
        scenario: type[Experiment[Any]] = SCENARIOS[name]
        folder = kept_run("run", name, "--no-report")
        self.metrics = json.loads((folder / "summary.json").read_text())["metrics"]
        self.experiment, self.parameters = scenario(), parse_parameters(scenario, [])
        self.file = folder / "signals.parquet"
        self.record = Record(self.file)
        self.plots = {p.title: p for p in self.experiment.plots(self.parameters, self.record)}

    def curve(self, title: str, label: str) -> Curve:
        return next(c for c in self.plots[title].curves if c.label == label)

    def metric(self, name: str) -> float:
        return float(self.metrics[name]["value"])


class Runs(dict[str, Run]):
    """Runs by scenario, made when they are asked for."""

    def __missing__(self, name: str) -> Run:
        self[name] = Run(name)
        return self[name]


@pytest.fixture(scope="module")
def runs() -> Runs:
    return Runs()


@pytest.mark.parametrize("name", SCENES)
def test_curves_are_as_long_as_the_record_and_phases_are_named(name: str, runs: Runs):
    done = runs[name]
    assert 3 <= len(done.plots) <= 15
    for plot in done.plots.values():
        labels = [c.label for c in plot.curves]
        assert len(set(labels)) == len(labels)
        assert all(c.values.shape == done.record.time.shape for c in plot.curves), plot.title
        assert any(np.isfinite(c.values).any() for c in plot.curves), plot.title
        assert all(p.begin <= p.end for p in plot.phases), plot.title
        assert all(a.end == b.begin and a.name != b.name for a, b in pairwise(plot.phases)), plot.title


def test_every_scenario_has_plots_of_its_own():
    assert all(s.time_figures is not Experiment.time_figures for s in SCENARIOS.values())


def test_a_push_disagrees_with_the_model_as_much_as_the_summary_says(runs: Runs):
    done = runs["flyer_impedance"]
    titles = [f"Error of the gripper's position, rest minus actual, {axis} of W" for axis in "xyz"]
    apart = [
        np.nanmax(np.abs(done.curve(title, "actual").values - done.curve(title, "calculated").values))
        for title in titles
    ]
    assert max(apart) == pytest.approx(1000 * done.metric("disagreement_position"))


def test_joints_are_in_degrees_and_the_error_is_drawn_on_the_path_only(runs: Runs):
    done = runs["vsl_hybrid"]
    assert done.curve("Joints", "J2, measured").values == pytest.approx(np.degrees(done.record["arm.q_meas"][:, 1]))
    error = done.curve("Error of the tip, on the path", "tip by the tracker").values
    assert (np.isfinite(error) == done.record["planner.moving"]).all()
    assert np.nanmax(error) >= 1000 * done.metric("max_error") - 1e-9


def test_fingers_that_see_nothing_are_not_drawn_and_a_cost_as_measured_only_while_thumb_and_ring_see(runs: Runs):
    done = runs["ir_grasp"]
    distance = done.record["reflex.distance"]
    for i, finger in enumerate(("thumb", "index", "ring")):
        seen = done.curve("Distances of the fingers from the object", f"{finger}, as seen").values
        assert np.array_equal(np.isnan(seen), distance[:, i] >= 0.065)
    plot = done.plots["Cost of thumb and ring, [Luberto] eq. (4)"]
    measured, partly = plot.curves
    assert plot.logarithmic
    seeing = (distance[:, [0, 2]] < 0.065).sum(axis=1)
    assert {0, 1, 2} == set(seeing.tolist())
    assert np.array_equal(np.isfinite(measured.values), seeing == 2)
    assert np.array_equal(np.isfinite(partly.values), seeing == 1)
    assert np.nanmin(measured.values) > 0.0
    assert np.nanmax(partly.values) < 3025.0


@pytest.mark.usefixtures("empty_figures")
@pytest.mark.parametrize("name", ["ir_grasp", "flyer_impedance"])
def test_page_and_figure_draw_the_same_curves_in_the_same_colours(
    name: str, runs: Runs, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    done = runs[name]
    drawn: dict[str, list[tuple[str, str]]] = {}

    def note(axes: Axes, plot: TimePlot, time: Floats) -> None:
        draw_time_plot(axes, plot, time)
        lines = [line for line in axes.lines if str(line.get_label())]
        drawn[plot.title] = [(str(line.get_label()), str(line.get_color())) for line in lines]

    monkeypatch.setattr("handover.scenarios.experiment.plotting.draw_time_plot", note)
    figures = done.experiment.time_figures(done.parameters, done.record)
    made = draw_time_figures(figures, done.record.time, tmp_path)
    assert {p.name for p in tmp_path.iterdir()} == {f"{f.name}.{kind}" for f in made for kind in ("png", "svg")}
    assert set(drawn) == set(done.plots)
    for title, plot in done.plots.items():
        traces: tuple[Any, ...] = time_figure(plot, done.record.time).data  # type: ignore
        on_page = [(t.name, t.line.color) for t in traces]
        assert [label for label, _ in drawn[title]] == [label for label, _ in on_page]
        curves = drawn[title][: len(plot.curves)]
        assert [f"var(--c{COLOURS.index(colour)})" for _, colour in curves] == [c for _, c in on_page[: len(curves)]]


def test_labels_of_axes_are_whole_where_the_lowest_tick_is_at_an_axis_end(runs: Runs, tmp_path: Path):
    """Of the base's displacement, whose axis ends 0.1 mm below its tick at -10 mm."""
    done = runs["flyer_arm_impedance"]
    (figure,) = (f for f in done.experiment.time_figures(done.parameters, done.record) if f.name == "yielding")
    draw_time_figures([figure], done.record.time, tmp_path)
    picture = np.asarray(cv2.imread(str(tmp_path / "yielding.png")))
    assert picture[:, :3].min() > 200
