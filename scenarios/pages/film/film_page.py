"""The page that a film is made of: a run's scene beside plots over time, at the time that `film.js` is called with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from handover.cosim.exceptions import nearest
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import COLOURS, Curve, TimePlot, phases_of
from handover.scenarios.runs.reporting.html import json_html
from handover.scenarios.runs.reporting.page import Section, asset, page_html, template
from handover.scenarios.runs.reporting.replay_section import SCENE_SCRIPTS, drawn_groups, legend_html, scene_content
from handover.scenarios.runs.reporting.run_figures import figures_of_outputs
from handover.scenarios.runs.reporting.run_page import replay_and_plots
from handover.scenarios.runs.reporting.time_plots import time_figure
from handover.scenarios.runs.results.run_facts import RunFacts, elements_of, record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults, drawing

VIEWS = ("start", "front", "side", "top", "follow")
MAX_FRAMES = 3000
"""Rows of the record that a film shows; between them it interpolates."""
_LEAST_HEIGHT = 130
"""Of a plot with its title, px."""
_TWO_PLOTS = 520
"""Height from which two plots are shown where none is named, px."""
_HEAD = 48
"""Height of a film's heading, px."""
_SCENE_SHARE = 0.5
"""Height of the scene where plots are below it, as a share of the film's."""
_NUMBERS = "fiub"
"""Kinds of arrays that can be plotted."""


class NotFilmed(ValueError):
    """A film that cannot be made as it is asked for; the message says why, and what can be."""


@dataclass(frozen=True, kw_only=True)
class FilmContent:
    """What a film shows of a run.

    Attributes:
        title: of the run, in a line.
        record: of the run.
        replay: its scene; None where it has none, or none that can be drawn.
        scene: that as `scene.js` takes it.
        plots: over the record's time.
        notes: what could not be shown, a line each.
    """

    title: str
    record: Record
    replay: Replay | None
    scene: Mapping[str, Any] | None
    plots: Sequence[TimePlot]
    notes: Sequence[str]

    @property
    def span(self) -> tuple[float, float]:
        """The first and the last time of the record, s."""
        return float(self.record.time[0]), float(self.record.time[-1])


@drawing
def film_content(folder: RunFolder, names: Sequence[str] | None, height: int) -> FilmContent:
    """Return what a film of a run shows: its scene, and plots.

    Args:
        folder: the run's, whose record is complete.
        names: titles of the scenario's plots, or signals, "arm.p_WG" or "arm.p_WG[3]"; none named: the first that there
            are; None: no plots.
        height: of the film's page, px, on which depends how many plots that are.

    Raises:
        InvalidRunFolder: it is not the folder of a run, it is damaged, or it has no record over time.
        NotFilmed: a name is of no plot and no signal, or there is nothing to be shown.
    """
    facts, record = RunFacts.read(folder), record_of(folder)
    if record is None:
        why = facts.missing_record or "its record has less than two rows"
        raise InvalidRunFolder(folder.path, f"there is nothing to film: {why}")
    faults = ToleratedFaults()
    replay, own = None, list[TimePlot]()
    try:
        replay, own, shown = replay_and_plots(facts, record, faults)
        record = shown
    except (InvalidParameter, KeyError) as e:
        why = e.args[0] if e.args else e
        faults.lines.append(f"the run is of another version of {facts.scenario}, so its scene is left out: {why}")
    if facts.experiment is None:
        faults.lines += facts.not_drawn
        own = [p for f in figures_of_outputs(facts.run.get("units", {}), record) for p in f.plots]
    plots = [] if names is None else _chosen(own, record, names) if names else own[: 2 if height >= _TWO_PLOTS else 1]
    scene = None
    if replay is not None:
        with faults.tolerated("the scene could not be drawn"):
            scene = scene_content(replay, record, frames=MAX_FRAMES)
    if scene is None and not plots:
        raise NotFilmed(_nothing(facts, faults))
    return FilmContent(
        title=f"{facts.scenario}: {facts.title}" if facts.title else facts.scenario,
        record=record,
        replay=replay if scene else None,
        scene=scene,
        plots=plots,
        notes=faults.lines if replay or faults.lines else [f"{facts.scenario} has no scene: the film has plots only"],
    )


def _nothing(facts: RunFacts, faults: ToleratedFaults) -> str:
    why = f": {'; '.join(faults.lines)}" if faults.lines else ""
    return f"{facts.scenario} has neither a scene nor plots to be filmed{why}; --plot takes its signals"


def _chosen(own: Sequence[TimePlot], record: Record, names: Sequence[str]) -> list[TimePlot]:
    """Return the plots that are named, in that order.

    Raises:
        NotFilmed: names are of no plot and no signal; all of these are named.
    """
    by_title = {plot.title.casefold(): plot for plot in own}
    found = {name: by_title.get(name.casefold()) or _of_signal(record, name) for name in dict.fromkeys(names)}
    if unknown := [name for name, plot in found.items() if plot is None]:
        raise NotFilmed("; ".join(f"--plot {name}: {_why_not(own, record, name)}" for name in unknown))
    return [plot for plot in found.values() if plot is not None]


def _why_not(own: Sequence[TimePlot], record: Record, name: str) -> str:
    """Return why a name is of no plot, and which names there are."""
    signal = name if name in record.signals else name.rpartition("[")[0]
    if signal not in record.signals:
        return f"no plot or signal of that name; {nearest(name, [*(plot.title for plot in own), *record.signals])}"
    if record[signal].dtype.kind not in _NUMBERS:
        return f"{signal} has no numbers to plot"
    elements = list(elements_of(signal, record[signal]))
    if elements == [signal]:
        return f"{signal} is a single number, without elements"
    return f"{signal} has the elements {elements[0]} to {elements[-1]}"


def _of_signal(record: Record, name: str) -> TimePlot | None:
    """Return a plot of a signal or of one of its elements; None if there are no such numbers."""
    signal = name if name in record.signals else name.rpartition("[")[0]
    if signal not in record.signals or record[signal].dtype.kind not in _NUMBERS:
        return None
    elements = elements_of(signal, record[signal])
    if name != signal:
        if name not in elements:
            return None
        elements = {name: elements[name]}
    values = {label: v.astype(np.float64) for label, v in list(elements.items())[: len(COLOURS)]}
    unit = display_unit(record.unit(signal), np.concatenate(list(values.values())))
    held, phases = record[signal].dtype.kind != "f", phases_of(record, signal) if record.items(signal) else ()
    quantity = name.partition(".")[2] or name
    if len(values) == 1:
        values = {quantity: next(iter(values.values()))}
    curves = [Curve(label=label, values=v * unit.factor, held=held) for label, v in values.items()]
    return TimePlot(title=name, quantity=quantity, unit=unit.symbol, curves=curves, phases=phases)


def most_plots(size: tuple[int, int], *, scene: bool) -> int:
    """Return how many plots fit into a page of a size, px, with or without a scene."""
    height = size[1]
    room = height - _HEAD if _is_wide(size) or not scene else _SCENE_SHARE * height
    return int(room // _LEAST_HEIGHT)


def _is_wide(size: tuple[int, int]) -> bool:
    """Return whether plots stand beside the scene, and not below it."""
    return size[0] > 1.2 * size[1]


def film_html(content: FilmContent, size: tuple[int, int], view: str) -> str:
    """Return the page of a film, as large as its window.

    Args:
        content: what it shows.
        size: of the window, px.
        view: one of `VIEWS`.

    Raises:
        NotFilmed: the scene follows nothing.
    """
    replay, record = content.replay, content.record
    if view == "follow" and replay is not None and not replay.follow:
        raise NotFilmed(f"--view follow: this scene has nothing to follow; expected {', '.join(VIEWS[:-1])}")
    data: dict[str, Any] = {"scene": None, "view": view, "phases": []}
    legend = Markup()
    if replay is not None and content.scene is not None:
        data |= {"scene": content.scene, "phases": content.scene["phases"]}
        legend = legend_html([d for group in drawn_groups(replay, record) for d in group])
    wide = _is_wide(size)
    shape = "scene-only" if not content.plots else "plots-only" if replay is None else "beside" if wide else "below"
    html = template("film/film.html").render(
        shape=shape,
        title=content.title,
        data=json_html(data),
        legend=legend,
        plots=[(p.title, json_html(time_figure(p, record.time).to_dict())) for p in content.plots],
    )
    style = Markup(f"<style>{asset('scene/replay.css')}{asset('film/film.css')}</style>")
    scripts = (*SCENE_SCRIPTS, "phases.js", "film/film.js")
    return page_html(
        content.title, Markup(""), [Section(anchor="film", title="Film", html=style + Markup(html), scripts=scripts)]
    )
