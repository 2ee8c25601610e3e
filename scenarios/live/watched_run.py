"""A run under way as the live page's server sees it: its folder, its growing record, its end."""

import shlex
import sys
from pathlib import Path
from typing import Any

from handover.cosim.record.growing_record import GrowingRecord, NoRows
from handover.scenarios.catalog import scenario_of
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.live_inputs import LedHand
from handover.scenarios.experiment.parameters import InvalidParameter, parameters_of
from handover.scenarios.live.live_scene import LiveScene, RecordedScene
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder


class WatchedRun:
    """What is known of a run from its folder, which another process writes.

    Args:
        path: the run's folder, which need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.folder = RunFolder.of_run(path)

    def scene(self) -> LiveScene | None:
        """Return the scene of the run; None if it has not written its first row, or its last one already."""
        try:
            record = GrowingRecord(self.folder.signals)
            return LiveScene(*self._scenario(), record)
        except (NoRows, InvalidRunFolder):
            return None

    def recorded_scene(self) -> RecordedScene | None:
        """Return the scene of the run that is over; None where it left no record that can be read."""
        record = whole_record_of(self.folder)
        return None if record is None else RecordedScene(*self._scenario(), record)

    def _scenario(self) -> tuple[Experiment[Any] | None, Any]:
        """Return the scenario and its parameters; None for a system without, or where it cannot be had."""
        run = self.folder.read_run()
        kind = scenario_of(run["scenario"], run.get("source", {}))
        if kind is None:
            return None, None
        try:
            return kind(), parameters_of(kind, run["parameters"])
        except InvalidParameter as e:
            print(f"the live page has no scene: {e}", file=sys.stderr)
            return None, None

    def led_hand(self) -> LedHand | None:
        """Return the hand of the run that somebody outside leads, if there is one.

        Raises:
            InvalidRunFolder: the run has not begun.
        """
        run = self.folder.read_run()
        kind = scenario_of(run["scenario"], run.get("source", {}))
        return None if kind is None else kind().led_hand(parameters_of(kind, run["parameters"]))

    @property
    def title(self) -> str:
        """The scenario's name and what it does."""
        try:
            run = self.folder.read_run()
        except InvalidRunFolder:
            return ""
        return ": ".join(str(run[key]) for key in ("scenario", "title") if run.get(key))

    @property
    def has_verdict(self) -> bool:
        """Whether the run has written its verdict."""
        return (self.folder.path / "summary.json").is_file()

    @property
    def verdict(self) -> dict[str, object]:
        """Return whether it has a verdict, whether it succeeded, why, where its report is, and what makes it again."""
        try:
            summary = self.folder.read_summary()
        except InvalidRunFolder as e:
            return {"judged": False, "success": False, "reason": str(e), "report": ""}
        if not summary:
            return {"judged": False, "success": False, "reason": self.why_lost, "report": ""}
        return {
            "judged": True,
            "success": bool(summary.get("success")),
            "reason": str(summary.get("reason", "")),
            "report": str(self.folder.report) if self.folder.report.is_file() else "",
            "again": f"handover run --config {shlex.quote(str(self.folder.path / 'run.json'))} --live",
        }

    @property
    def why_lost(self) -> str:
        """What is left of a run whose process has ended, as by a signal, before it could write a summary."""
        place = self.folder.shown
        if self.folder.checkpoint.is_file():
            return f"its process has ended; `handover resume {place}` goes on from its last checkpoint"
        return f"its process has ended; what it recorded is in {place}, without a checkpoint to go on from"
