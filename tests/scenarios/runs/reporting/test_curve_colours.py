"""Curves have the page's colours, and what is also seen in space has there the colour of its curve."""

import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import COLOURS
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.runs.reporting.time_plots import time_figure

PAGE = files("handover.scenarios.runs.reporting") / "page"


def page_colours() -> list[dict[str, str]]:
    """Return the colours of curves by name, by day and by night."""
    both = (PAGE / "page.css").read_text(encoding="utf-8").split("prefers-color-scheme: dark")
    return [dict(re.findall(r"--(c\d+): (#\w{6});", part)) for part in both]


def test_the_page_has_as_many_colours_as_are_given_to_curves():
    names = [f"c{k}" for k in range(len(COLOURS))]
    assert [list(colours) for colours in page_colours()] == [names, names]
    assert tuple(page_colours()[0].values()) == COLOURS
    script = (PAGE / "page.js").read_text(encoding="utf-8")
    assert re.findall(r'"(c\d+)"', script) == names
    assert re.findall(r"c\.(c\d+)", script) == names
    assert f"colour++ % {len(COLOURS)}" in (PAGE / "explorer.js").read_text(encoding="utf-8")


def test_a_finger_is_as_coloured_in_space_as_its_curve(grasp: Path):
    record, parameters = Record(grasp / "signals.parquet"), Parameters()
    distances = IrGrasp().plots(parameters, record)[0]
    traces: tuple[Any, ...] = time_figure(distances, record.time).data  # type: ignore
    names = {t.name.split(",")[0]: t.line.color for t in traces}
    lines = {line.label: line.colour for line in IrGrasp().replay(parameters, record).lines}
    day = page_colours()[0]
    for finger in ("thumb", "index", "ring"):
        assert lines[finger] == day[re.sub(r"var\(--(.*)\)", r"\1", names[finger])]
