"""Runs one trial of a study: `python -m handover.scenarios.study.session SPEC`, started by `Trial`; SPEC is in JSON."""

import contextlib
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.task import InputSources

_GRACE = 5.0
"""Time that a run gets to end after its step, s."""


def _end_with_parent() -> None:
    """End the run when the process has ended that started it, and else held the other end of standard input."""
    sys.stdin.buffer.read()
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_GRACE)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    spec = json.loads(sys.argv[1])
    inputs, control = SharedInputs(Path(spec["inputs"])), LiveControl(Path(spec["control"]))
    with Interruption() as interruption, contextlib.ExitStack() as resources:
        task = RunRequest(
            subject=spec["scenario"],
            parameters=spec["parameters"],
            seed=spec["seed"],
            out=Path(spec["out"]),
            presented=False,
            sources=InputSources(inputs.sources(), spec["led_by"], where="the study's page", is_complete=True),
        ).task(resources)
        run_task(task, lambda _t, _end: None, interruption, control=control)
