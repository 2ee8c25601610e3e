"""A host that leaves a fork when it is killed: `python forking_host.py FMU`, with the tests' folder on the PYTHONPATH.

It makes an instance, which steps once, and forks; it prints the fork's number and waits. The fork keeps open all but
the standard output, and waits, too.
"""

import os
import signal
import sys
from pathlib import Path

from support.fmus.ctypes_host import OK, CtypesHost


def main(fmu: str) -> None:
    """Run until killed."""
    host = CtypesHost(Path(fmu), 3)
    if not host.instantiate() or host.initialise() != OK or host.step(0.0, 1 / 64) != OK:
        sys.exit("\n".join(host.log))
    if int(host.get("process")[0]) == os.getpid():
        sys.exit("the unit runs in the host's own process")
    fork = os.fork()
    if fork:
        print(fork, flush=True)
    else:
        os.close(1)
    signal.pause()


if __name__ == "__main__":
    main(*sys.argv[1:])
