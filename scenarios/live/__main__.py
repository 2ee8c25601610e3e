"""Serves the page of a run: `python -m handover.scenarios.live FOLDER CONTROLS SOCKET [WEBCAM]`, for `handover run`."""

import signal
import socket
import sys
from pathlib import Path

from handover.scenarios.live.server import watch

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run's: it ends, and this with it
    folder, controls, number, *webcam = sys.argv[1:]
    watch(Path(folder), Path(controls), socket.socket(fileno=int(number)), *map(Path, webcam))
