"""What is drawn over time is described once: phases by name, colours by group, and names over figures for papers."""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from matplotlib.figure import Figure as Canvas
from matplotlib.text import Annotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment import plotting
from handover.scenarios.experiment.plotting import draw_time_figures, figure, name_phases
from handover.scenarios.experiment.time_plot import COLOURS, Curve, Level, Phase, TimeFigure, TimePlot, phases_of
from handover.scenarios.runs.reporting.time_plots import time_figure, time_plots_section


@pytest.fixture
def record(tmp_path: Path) -> Record:
    """Return six rows, a second apart, of an enumeration's signal."""
    phase = pa.field("servo.phase", pa.int64(), metadata={"items": "0 WAIT, 1 LOOK_FAR, 2 LOOK_NEAR, 3 DONE"})
    schema = pa.schema([pa.field("time", pa.float64()), phase])
    table = pa.Table.from_pydict({"time": np.arange(6.0), "servo.phase": np.array([0, 1, 2, 2, 1, 3])}, schema=schema)
    pq.write_table(table, tmp_path / "signals.parquet")
    return Record(tmp_path / "signals.parquet")


def spans(phases: tuple[Phase, ...]) -> list[tuple[float, float, str]]:
    return [(p.begin, p.end, p.name) for p in phases]


def layout_on_page(plot: TimePlot, time: Floats) -> Any:
    return time_figure(plot, time).layout  # type: ignore


def test_phases_have_the_names_of_the_enumeration(record: Record):
    assert spans(phases_of(record, "servo.phase")) == [
        (0.0, 1.0, "wait"),
        (1.0, 2.0, "look far"),
        (2.0, 4.0, "look near"),
        (4.0, 5.0, "look far"),
        (5.0, 5.0, "done"),
    ]


def test_neighbours_of_one_name_are_one_phase_and_one_stripe(record: Record):
    phases = phases_of(record, "servo.phase", {0: "wait", 1: "look", 2: "look", 3: ""})
    assert spans(phases) == [(0.0, 1.0, "wait"), (1.0, 5.0, "look"), (5.0, 5.0, "")]
    plot = TimePlot(title="", quantity="x", unit="", curves=[Curve(label="x", values=record.time)], phases=phases)
    assert [p["name"] for p in layout_on_page(plot, record.time).meta["phases"]] == ["wait", "look", ""]


def test_groups_have_one_colour_and_a_palette_keeps_it_where_others_are_missing():
    values = np.zeros(2)
    curves = [
        Curve(label="tip, true", values=values, group="tip"),
        Curve(label="goal", values=values),
        Curve(label="tip, seen", values=values, group="tip"),
    ]
    plot = TimePlot(title="", quantity="x", unit="mm", curves=curves)
    assert plot.colours == (0, 1, 0)
    kept = TimePlot(title="", quantity="x", unit="mm", curves=curves[1:], palette=("tip", "arm"))
    assert kept.colours == (2, 0)
    many = [Curve(label=str(k), values=values) for k in range(len(COLOURS) + 1)]
    assert TimePlot(title="", quantity="x", unit="", curves=many).colours[-1] == 0


def test_levels_are_reported_with_their_unit():
    levels = [Level(label="full", value=2.5)]
    reported = [TimePlot(title="", quantity="x", unit=unit, curves=(), levels=levels) for unit in ("mm", "°", "")]
    assert [plot.level_labels for plot in reported] == [("full: 2.5 mm",), ("full: 2.5°",), ("full: 2.5",)]


def test_an_axis_with_one_limit_shows_all_that_is_drawn():
    curve = Curve(label="x", values=np.array([20.0, np.nan, 100.0]))
    plot = TimePlot(title="", quantity="x", unit="", curves=[curve], limits=(0.0, None))
    assert plot.shown_range == (0.0, pytest.approx(106.0))
    assert layout_on_page(plot, np.arange(3.0)).yaxis.range == plot.shown_range
    assert TimePlot(title="", quantity="x", unit="", curves=[curve]).shown_range is None


def phases_at(edges: list[float], names: list[str]) -> list[Phase]:
    return [Phase(begin=a, end=b, name=name) for (a, b), name in zip(pairwise(edges), names, strict=True)]


def test_short_phases_are_named_upright_where_their_name_fits_over_no_other_as_far_as_there_is_room(tmp_path: Path):
    edges = [0.0, 20.0, 20.5, 40.0, 40.5, 59.0, 59.5, 60.0]
    phases = phases_at(edges, ["check", "probe", "check", "probe", "check", "step", "probe"])
    with figure(tmp_path / "phases", 1) as (axes,):
        axes.set_xlim(0.0, 60.0)
        name_phases(axes, phases, 60.0 / 500.0)
        upright = [text for text in axes.texts if isinstance(text, Annotation)]
        assert sorted(text.get_text() for text in upright) == ["probe", "step"]
        assert [text.get_text() for text in axes.texts if text not in upright] == ["check"] * 3
        before = len(axes.texts)
        edges = np.linspace(0.0, 60.0, 202).tolist()
        name_phases(axes, phases_at(edges, [f"phase {k}" for k in range(201)]), 60.0 / 480.0)
        assert 10 < len(axes.texts) - before < 201


def test_a_phase_without_length_as_at_the_end_of_a_run_takes_no_room(tmp_path: Path):
    with figure(tmp_path / "phases", 1) as (axes,):
        name_phases(axes, phases_at([0.0, 60.0, 60.0], ["descend", "grasp"]), 60.0 / 500.0)
        assert [text.get_text() for text in axes.texts] == ["descend"]


@pytest.mark.parametrize(("right", "legends"), [(("actual", "calculated"), 1), (("x", "y"), 2)])
def test_columns_of_plots_with_the_same_curves_share_a_legend(
    right: tuple[str, ...], legends: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    saved = Mock()
    monkeypatch.setattr(plotting, "_save", saved)
    plots = [plot("x", "actual", "calculated"), plot("y", "actual", "calculated"), plot("z", *right), plot("w", *right)]
    draw_time_figures([TimeFigure(name="f", caption="", plots=plots, columns=2)], np.arange(3.0), tmp_path)
    canvas: Canvas = saved.call_args.args[0]
    assert len([*canvas.legends, *(a for a in canvas.axes if a.get_legend() is not None)]) == legends


def test_a_signal_of_which_nothing_is_known_has_no_phases(tmp_path: Path):
    table = pa.Table.from_pydict({"time": np.arange(3.0), "servo.phase": np.full(3, np.nan)})
    pq.write_table(table, tmp_path / "s.parquet")
    assert phases_of(Record(tmp_path / "s.parquet"), "servo.phase") == ()


def plot(title: str, *labels: str, phases: tuple[Phase, ...] = (), unit: str = "mm") -> TimePlot:
    curves = [Curve(label=label, values=np.arange(3.0)) for label in labels]
    return TimePlot(title=title, quantity=title, unit=unit, curves=curves, phases=phases)


PHASES = (Phase(begin=0.0, end=1.5, name="wait"), Phase(begin=1.5, end=2.0, name="look"))


def test_plots_of_one_legend_are_panels_of_one_figure_which_names_their_phases_once():
    of_robot = [plot(name, "hand", "object", phases=PHASES) for name in "xyz"]
    others = [plot("speed", "true", phases=PHASES), plot("force", "true", phases=PHASES[:1])]
    section = time_plots_section([*of_robot, *others, *of_robot[:1]], np.arange(3.0))
    assert section is not None
    figures = [json.loads(text) for text in re.findall(r'<script type="application/json">(.*?)</script>', section.html)]
    assert [f["layout"]["meta"]["brief"] for f in figures] == [False, True, False, True]
    layout, traces = figures[0]["layout"], figures[0]["data"]
    assert [layout[axis]["title"]["text"] for axis in ("yaxis", "yaxis2", "yaxis3")] == ["x (mm)", "y (mm)", "z (mm)"]
    assert layout["xaxis"]["anchor"] == "y3"
    assert [(t["name"], t["yaxis"]) for t in traces if t["showlegend"]] == [("hand", "y"), ("object", "y")]
    assert [t["yaxis"] for t in traces] == ["y", "y", "y2", "y2", "y3", "y3"]
    assert [a["text"] for a in layout["annotations"]] == ["y", "z"]
    (z, y, x) = sorted(layout[axis]["domain"] for axis in ("yaxis", "yaxis2", "yaxis3"))
    assert 0.0 <= z[0] < z[1] < y[0] < y[1] < x[0] < x[1] == 1.0


def test_a_figure_has_a_few_panels_at_most():
    section = time_plots_section([plot(f"output {k}", f"output {k}", unit="") for k in range(13)], np.arange(3.0))
    assert section is not None
    assert section.html.count('class="plot"') == 3
