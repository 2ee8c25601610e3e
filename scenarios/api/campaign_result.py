"""The result of a campaign, read from its folder: its runs, and success rates and medians of metrics by point."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from handover.cosim.exceptions import visible
from handover.scenarios.api.arguments import errors_for_python, path_of
from handover.scenarios.api.pages import Page
from handover.scenarios.api.run_result import Quantity, Run
from handover.scenarios.api.signals import data_frame
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.execution.errors import require_extra

if TYPE_CHECKING:
    from pandas import DataFrame

    from handover.scenarios.runs.campaign.results import PointResults


@dataclass(frozen=True, kw_only=True)
class CampaignPoint:
    """The runs of one combination of values.

    Attributes:
        values: of the parameters that are varied, as texts.
        runs: how many came to their end.
        successes: how many of these succeeded.
        interval: 95 % confidence interval of the rate of success; None where no run came to its end.
        medians: of the metrics that tables show, over the runs that have them.
    """

    values: Mapping[str, str]
    runs: int
    successes: int
    interval: tuple[float, float] | None
    medians: Mapping[str, Quantity]

    @property
    def rate(self) -> float:
        """Share of the runs that succeeded; NaN where none came to its end."""
        return self.successes / self.runs if self.runs else float("nan")


class Campaign:
    """A campaign, as its folder has it; also one that was interrupted, as far as it got.

    Attributes:
        folder: where its table and the folders of its runs are.
    """

    def __init__(self, folder: Path | str) -> None:
        """Read a campaign's folder.

        Raises:
            InvalidInput: it is not the folder of a campaign, or it is damaged; or SciPy is not installed.
        """
        from handover.scenarios.runs.campaign.table_writer import rebuild_table

        self.folder = path_of("folder", folder)
        self._place = CampaignFolder(self.folder)
        with errors_for_python():
            try:
                from handover.scenarios.runs.campaign.results import read_results  # its statistics take long to load
            except ImportError:
                require_extra("campaigns", "campaigns")
                raise
            rebuild_table(self._place)
            self._results = read_results(self._place)

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self._results.scenario

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each run that has ended, with parameters, seed, status, verdict, times and metrics; see `unit`."""
        return self._results.table.rows

    def unit(self, column: str) -> str:
        """Return the unit of a column of `rows`, "1" where it has none.

        Raises:
            KeyError: there is no such column.
        """
        return self._results.table.unit(column)

    @functools.cached_property
    def points(self) -> tuple[CampaignPoint, ...]:
        """The combinations of values of which a run has ended."""
        return tuple(self._point(point) for point in self._results.points)

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs that have ended, in the order of `rows`; those that were lost have no folder and are left out."""
        folders = [self._place.runs / str(row["run"]) for row in self.rows]
        return tuple(Run(folder) for folder in folders if folder.is_dir())

    def to_pandas(self) -> "DataFrame":
        """Return `rows` as a table; its `attrs["units"]` has the columns' units.

        Raises:
            ImportError: pandas is not installed.
        """
        columns = self._results.table.table.to_pydict()
        return data_frame(columns, {name: self.unit(name) for name in columns})

    def report(self) -> Page:
        """Write the report page into the folder, and return it.

        Raises:
            InvalidInput: a file of the folder is damaged, or the extra `reports` is not installed.
            RecordNotWritten: the disk is full.
        """
        with errors_for_python():
            require_extra("reports", "reports")
        # Plotly takes long to load.
        from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page

        with errors_for_python():
            write_campaign_page(self._place)
        return Page(self._place.report.read_text(encoding="utf-8"), self._place.report)

    def __repr__(self) -> str:
        """Return how many runs succeeded, and where the results are."""
        return visible(f"<campaign of {self.scenario}: {self._outcome}; {self.folder}>")

    @property
    def _outcome(self) -> str:
        results = self._results
        return f"{results.successes} of {results.done} runs succeeded, {results.planned} planned"

    def _point(self, point: "PointResults") -> CampaignPoint:
        table, results = self._results.table, self._results
        medians = {
            name: Quantity(results.median(point, name), table.unit(name), table.description(name))
            for name in results.shown_metrics
        }
        interval = None if point.interval is None else (point.interval.low, point.interval.high)
        return CampaignPoint(
            values=point.values,
            runs=len(point.done),
            successes=point.successes,
            interval=interval,
            medians={name: median for name, median in medians.items() if not np.isnan(median)},
        )

    def _repr_html_(self) -> str:
        from markupsafe import Markup

        from handover.scenarios.api.notebook_forms import table_html

        varied, metrics = self._results.varied, self._results.shown_metrics
        header = [*varied, "succeeded", "95 % interval", *(f"{name}, median" for name in metrics)]
        rows = [_row(point, varied, metrics) for point in self.points]
        html = Markup("<div><p><b>{}</b>: {}</p>{}<p><small>results: {}</small></p></div>")
        return str(html.format(self.scenario, self._outcome, table_html(header, rows), str(self.folder)))


def _row(point: CampaignPoint, varied: Sequence[str], metrics: Sequence[str]) -> list[str]:
    interval = "" if point.interval is None else "{:.0f} to {:.0f} %".format(*(100 * end for end in point.interval))
    medians = [str(point.medians[name]) if name in point.medians else "–" for name in metrics]
    return [*(point.values.get(name, "") for name in varied), f"{point.successes} of {point.runs}", interval, *medians]
