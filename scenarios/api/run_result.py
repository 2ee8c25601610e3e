"""The result of a run, read from its folder: verdict, metrics, signals, figures, replay, report."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from handover.cosim.exceptions import nearest, visible
from handover.cosim.record.reader import Record
from handover.scenarios.api.arguments import InvalidInput, errors_for_python, path_of
from handover.scenarios.api.pages import Page
from handover.scenarios.api.signals import SignalTable
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parameters_of
from handover.scenarios.runs.execution.errors import require_extra
from handover.scenarios.runs.execution.resume import complete_signals
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.run_facts import RunFacts, record_of, whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tables import warning_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Quantity(float):
    """A number with its unit and what it is; it computes as a number.

    Attributes:
        unit: such as "m", "1" for a pure number.
        description: what it is, in a line.
    """

    unit: str
    description: str

    def __new__(cls, value: float, unit: str = "1", description: str = "") -> "Quantity":
        """Return the number."""
        quantity = super().__new__(cls, value)
        quantity.unit, quantity.description = unit, description
        return quantity

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what a copy is made of."""
        return Quantity, (float(self), self.unit, self.description)

    def __repr__(self) -> str:
        """Return the value in a unit that is easily read, such as "12.3 mm"."""
        return visible(display_unit(self.unit, float(self)).text(float(self)))

    __str__ = __repr__


class Metrics(dict[str, Quantity]):
    """Metrics by name; the error for an unknown one has the nearest names."""

    def __missing__(self, name: str) -> Quantity:
        """Raise KeyError."""
        raise KeyError(f"no metric {name!r}; {nearest(name, self)}")


class Run:
    """A run that has ended, as its folder has it. The folder stays until you remove it.

    Attributes:
        folder: where its record, verdict, configuration and what is drawn of it are.
    """

    def __init__(self, folder: Path | str, experiment: Experiment[Any] | None = None) -> None:
        """Read a run's folder; what a killed run has recorded is completed.

        Args:
            folder: the run's.
            experiment: its scenario, where that has no name by which it is found.

        Raises:
            InvalidInput: it is not the folder of a run, or not of one of this scenario, or a file in it is damaged.
        """
        self.folder = path_of("folder", folder)
        self._place = RunFolder.of_run(self.folder)
        with errors_for_python():
            self._facts = RunFacts.read(self._place, experiment)
            if not (self._facts.ended and self._place.signals.exists()):
                with self._place.held():
                    complete_signals(self._place)

    @property
    def scenario(self) -> str:
        """Name of the scenario, or of the file that was run; "system" for one that was wired in Python."""
        return self._facts.scenario

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The scenario's parameters, in SI units."""
        return dict(self._facts.run["parameters"])

    @property
    def seed(self) -> int | None:
        """Seed of all random numbers; None where there are none."""
        return self._facts.run.get("seed")

    @property
    def success(self) -> bool:
        """Whether the task succeeded."""
        return bool(self._facts.summary["success"])

    @property
    def reason(self) -> str:
        """Why it succeeded or failed, in a sentence; of a unit that failed, its call, time and message."""
        return str(self._facts.summary["reason"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Units of which calls answered Warning, and outputs that were not finite, a line each with the first time."""
        return tuple(warning_lines(self._facts.summary))

    @property
    def left_out(self) -> tuple[str, ...]:
        """What could not be evaluated or drawn, a line each."""
        return tuple(self._facts.summary.get("left_out", ()))

    @functools.cached_property
    def metrics(self) -> "Metrics":
        """Metrics by name, the headline's first, as numbers with `unit` and `description`; maybe NaN."""
        found: Mapping[str, Any] = self._facts.summary["metrics"]
        first = [name for name in self._facts.headline if name in found]
        ordered = {name: found[name] for name in dict.fromkeys([*first, *found])}
        return Metrics(
            (name, Quantity(float("nan") if m["value"] is None else m["value"], m["unit"], m.get("description", "")))
            for name, m in ordered.items()
        )

    @functools.cached_property
    def signals(self) -> SignalTable:
        """All outputs over time, `signals["arm.p_WG"]`, in SI units or those of their FMUs.

        Raises:
            InvalidInput: the run has no record, or a damaged one.
        """
        return SignalTable(self._record)

    def plot(self, *names: str, axes: "Axes | None" = None) -> "Figure":
        """Draw signals over time, below each other, with units at the axes; into `axes` where they are given.

        Raises:
            KeyError: there is no such signal; the nearest names are given.
            InvalidInput: matplotlib is not installed.
        """
        with errors_for_python():
            from handover.scenarios.api.signal_plots import plot_signals  # matplotlib takes long to load
        return plot_signals(self.signals, names, axes)

    def replay(self) -> Page:
        """Return the scene in space, to be turned and played in a notebook or, once saved, in a browser.

        Raises:
            InvalidInput: the scenario has no replay, the record is not one of this version's, or the extra `reports` is
                not installed.
        """
        with errors_for_python():
            require_extra("reports", "replays")
        from handover.scenarios.runs.reporting.page import page_html  # Plotly takes long to load
        from handover.scenarios.runs.reporting.replay_section import replay_section

        experiment = self._facts.experiment
        if experiment is None:
            why = "".join(f"; {line}, or import its module first" for line in self._facts.not_drawn)
            raise InvalidInput(f"{self.scenario} has no replay of its runs here{why}; plot() draws signals")
        with errors_for_python():
            record = LackingRecord(self._record, experiment.units)
            replay = experiment.replay(parameters_of(type(experiment), self.parameters), record)
        shown = None if replay is None else record.drawable_replay(replay)
        if shown is None:
            raise InvalidInput(f"{self.scenario} has no replay of this run; plot() draws signals")
        header = Markup("<p>{}</p>").format(self.reason)
        return Page(page_html(f"{self.scenario}: replay", header, [replay_section(shown, record)]), height=760)

    def report(self, figures: bool = False) -> Page:
        """Write the report page into the folder, and with `figures` the figures as PNG and SVG; return the page.

        Raises:
            InvalidInput: a file of the folder is damaged, or the extra `reports` is not installed.
            RecordNotWritten: the disk is full.
        """
        with errors_for_python():
            require_extra("reports", "reports")
        from handover.scenarios.runs.reporting.run_figures import draw_run
        from handover.scenarios.runs.reporting.run_page import write_run_page

        with errors_for_python(), self._place.held():
            if figures:
                draw_run(self._place, self._facts.experiment)
            write_run_page(self._place, experiment=self._facts.experiment)
        path = self.folder / self._place.report.name
        return Page(path.read_text(encoding="utf-8"), path)

    def __repr__(self) -> str:
        """Return the verdict and where the results are."""
        verdict = "succeeded" if self.success else "failed"
        return visible(f"<run of {self.scenario}: {verdict}, {self.reason}; {self.folder}>")

    def _repr_html_(self) -> str:
        from handover.scenarios.api.notebook_forms import run_html  # draws figures

        with errors_for_python():
            return run_html(self._facts, record_of(self._place))

    @functools.cached_property
    def _record(self) -> Record:
        with errors_for_python():
            record = whole_record_of(self._place)
            if record is None:
                none = "it has no record: the run ended before its first step"
                raise InvalidRunFolder(self.folder, self._facts.missing_record or none)
            return record
