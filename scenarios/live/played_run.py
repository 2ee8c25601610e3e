"""Runs that a session of `handover play` begins: each a process of its own, `handover run` with its parameters.

The run's controls lie in a scratch folder that `--controls` names, see `LiveControl`. Where the session's process ends,
however that is, the run ends after its step.
"""

import json
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.master.live_control import LiveControl
from handover.cosim.python_process import code_command
from handover.fmus.sources import source_file
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.live.process import CONTROL_FILE
from handover.scenarios.live.waiting_command import WaitingCommand
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.runs.execution.input_sources import recorded_input_names
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.selection import is_path_of_class
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tables import format_metric

_ENTRY = "from handover.scenarios.cli.entry import main; main()"


@dataclass(frozen=True)
class Choice:
    """What a run of a session is asked to be, besides what all have in common.

    Attributes:
        parameters: texts by name, of those that are set.
        seed: of all random numbers; None where there are none.
        pushed: whether the page may push.
    """

    parameters: Mapping[str, str] = field(default_factory=dict[str, str])
    seed: int | None = None
    pushed: bool = False

    def of(self, request: RunRequest) -> RunRequest:
        """Return a request for such a run."""
        given = [f"{name}={text}" for name, text in self.parameters.items()]
        return replace(request, parameters=given, seed=self.seed or 0)

    def arguments(self) -> list[str]:
        """Return them as options of `handover run`."""
        given = [part for name, text in self.parameters.items() for part in ("-p", f"{name}={text}")]
        seed = ["--seed", str(self.seed)] if self.seed else []
        return [*given, *seed, *(["--push"] if self.pushed else [])]


class PlayedRun:
    """A run of a session, from its begin on.

    Args:
        number: in the session, from 1.
        choice: what was asked for.
        subject: what is run, as the command takes it.
        options: of `handover run`, that all runs of the session have.
        folder: of the run, not there yet.
        pace: simulated seconds per second at first.
        waiting: the process that is to be the run's.
    """

    def __init__(
        self, number: int, choice: Choice, subject: str, options: Sequence[str], folder: Path, pace: float,
        waiting: WaitingCommand,
    ) -> None:  # fmt: skip
        self.number, self.choice, self._process = number, choice, waiting
        self.control = LiveControl.create(waiting.folder / CONTROL_FILE, pace, paused=True)
        self.watched = WatchedRun(folder)
        self.controls = waiting.folder
        self.superseded = False
        """Whether it was ended since another one was asked for."""
        self.has_report = False
        self._was_pushed: bool | None = None  # not known before it has ended
        self._subject, self._options = subject, options
        controls = ["--no-report", "--out", str(folder), "--controls", str(waiting.folder)]
        waiting.call(["run", subject, *choice.arguments(), *options, *controls])

    @property
    def command(self) -> str:
        """The command that makes the same run."""
        choice, folder = replace(self.choice, pushed=False), list[str]()
        if self.was_pushed or self._is_led:
            choice, folder = self.choice, ["--inputs-from", str(self.watched.folder.shown)]
        return f"handover run {shlex.join([self._subject, *choice.arguments(), *self._options, *folder])}"

    @property
    def _is_led(self) -> bool:
        """Whether a hand's inputs come from outside in it."""
        try:
            return self.watched.led_hand() is not None
        except (InvalidRunFolder, InvalidParameter):  # it has not begun, or was made by other units
            return False

    @property
    def was_pushed(self) -> bool:
        """Whether somebody has pushed in it; False as long as it goes on."""
        if self._was_pushed is None and self.has_ended:
            self._was_pushed = self.choice.pushed and _has_force_from_outside(self.watched.folder)
        return bool(self._was_pushed)

    @property
    def has_exited(self) -> bool:
        """Whether its process has ended."""
        return self._process.has_exited

    @property
    def has_ended(self) -> bool:
        """Whether it has its verdict, or its process has ended without one."""
        return self.watched.has_verdict or self.has_exited

    @property
    def is_refused(self) -> bool:
        """Whether its process has ended before there was anything of the run."""
        return self.has_exited and not self.watched.folder.is_there

    @property
    def error(self) -> str:
        """The last error that its process wrote on standard error."""
        return self._process.last_error.removeprefix("Error: ")

    def end(self) -> None:
        """Let it end after its step."""
        self.control.stop, self.control.paused = True, False

    def kill(self) -> None:
        """End its process, where that goes on."""
        self._process.process.kill()

    def close(self) -> None:
        """Wait for its process, and remove what it left besides its folder."""
        self._process.close()
        self.control.close()

    def write_report(self) -> str:
        """Write its page; return why that failed, "" if it did not."""
        own = ["--trust", str(source_file(self._subject))] if is_path_of_class(self._subject) else []
        given = code_command(_ENTRY, "report", str(self.watched.folder.path), *own)
        done = subprocess.run(given, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        self.has_report = done.returncode == 0
        return "" if self.has_report else (done.stderr.strip().splitlines() or ["it could not be written"])[-1]

    def row(self, headline: Sequence[str]) -> dict[str, Any]:
        """Return its row in the table of runs; metrics are those of a headline, or all where that is empty."""
        facts = {
            "number": self.number,
            "parameters": dict(self.choice.parameters),
            "seed": self.choice.seed,
            "pushed": self.was_pushed,
            "command": self.command,
            "folder": str(self.watched.folder.shown),
            "report": self.has_report,
        }
        summary = _summary_of(self.watched.folder)
        if not summary:
            state, reason = ("lost", self.watched.why_lost) if self.has_exited else ("under way", "")
            return {**facts, "state": state, "reason": reason, "metrics": []}
        state = "succeeded" if summary.get("success") else "ended by a change" if self.superseded else "failed"
        metrics: Mapping[str, Any] = summary.get("metrics", {})
        shown = [(name, metrics[name]) for name in (headline or metrics) if name in metrics]
        metric_rows = [{"name": name, "about": m.get("description", ""), "text": format_metric(m)} for name, m in shown]
        return {**facts, "state": state, "reason": str(summary.get("reason", "")), "metrics": metric_rows}


def _has_force_from_outside(folder: RunFolder) -> bool:
    """Return whether a force came from outside in a run, as its record says, that was not zero all along."""
    try:
        names, record = recorded_input_names(folder), whole_record_of(folder)
    except InvalidRunFolder:
        return False
    forces = [] if record is None else [record[n] for n in names if n in record and record.unit(n) == "N"]
    return any(bool(np.any(force)) for force in forces)


def _summary_of(folder: RunFolder) -> dict[str, Any]:
    try:
        return folder.read_summary()
    except (InvalidRunFolder, json.JSONDecodeError):
        return {}
