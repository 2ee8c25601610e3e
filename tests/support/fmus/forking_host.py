"""A host that leaves a fork when it ends: `python forking_host.py FMU DEED`, with the tests' folder on the PYTHONPATH.

It makes an instance, which steps once, and forks; it prints the fork's number and waits, or steps with a deed, one that
hangs, until a signal ends it. The fork keeps open all but the standard output, and waits, too.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

from support.fmus.ctypes_host import OK, CtypesHost
from support.processes import program, with_path


def main(fmu: str, deed: str) -> None:
    """Run until killed, or, with a deed, for a tenth of a second."""
    host = CtypesHost(Path(fmu), 3)
    if not host.instantiate() or host.initialise() != OK or host.step(0.0, 1 / 64) != OK:
        sys.exit("\n".join(host.log))
    if int(host.get("process")[0]) == os.getpid():
        sys.exit("the unit runs in the host's own process")
    fork = os.fork()
    if fork:
        print(fork, flush=True)
        if int(deed):
            signal.setitimer(signal.ITIMER_REAL, 0.1)  # whose signal ends this process
            host.put("Integer", "deed", int(deed))
            host.step(1 / 64, 1 / 64)
    else:
        os.close(1)
    signal.pause()


def expect_end_with_host(fmu: Path, deed: int = 0) -> None:
    """Fail unless the unit's process ends with such a host, killed or, with a deed, ended by a signal."""
    environment = with_path() | {"FMU_PYTHON_PROCESS": "1"}
    command = program("fmus/forking_host.py", fmu, int(deed))
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as host:
        assert host.stdout
        fork = int(host.stdout.readline())
        try:
            if not deed:
                host.kill()
            assert host.communicate(timeout=60)[0] == ""  # ends when the unit's process does, which has the pipe, too
            os.kill(fork, 0)  # which lives
        finally:
            os.kill(fork, signal.SIGKILL)


if __name__ == "__main__":
    main(*sys.argv[1:])
