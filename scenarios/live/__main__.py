"""Serves the page of a run: `python -m handover.scenarios.live FOLDER CONTROLS SOCKET SCENARIO [WEBCAM]`.

`handover run` starts it, and names its scenario's class: no code is run because the folder names it.
"""

import signal
import socket
import sys
from pathlib import Path

from handover.scenarios.live.server import watch
from handover.scenarios.runs.execution.selection import find_scenario

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run's: it ends, and this with it
    folder, controls, number, scenario, *webcam = sys.argv[1:]
    if scenario:
        find_scenario(scenario)
    watch(Path(folder), Path(controls), socket.socket(fileno=int(number)), *map(Path, webcam))
