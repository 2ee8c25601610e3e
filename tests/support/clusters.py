"""Dask clusters as a user runs them: a scheduler and workers, each a process, on the loopback interface."""

import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import cast

from support.processes import until


@contextlib.contextmanager
def running(folder: Path, *command: str, **environment: str) -> Generator["subprocess.Popen[bytes]", None, None]:
    """Run a command of Dask in a folder until the end of the block."""
    command = (sys.executable, "-m", "dask", *command)
    nowhere, around = subprocess.DEVNULL, {**os.environ, **environment}
    with subprocess.Popen(command, stdout=nowhere, stderr=nowhere, cwd=folder, env=around) as process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()


@contextlib.contextmanager
def scheduler(folder: Path) -> Generator[str, None, None]:
    """Run a scheduler; give its address."""
    text = folder / "scheduler.json"
    command = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(text)]
    with running(folder, *command) as process:
        until(lambda: (text.exists() and text.read_text().endswith("}")) or process.poll() is not None, 300.0)
        yield json.loads(text.read_text())["address"]


@contextlib.contextmanager
def worker(folder: Path, address: str, threads: int = 1, **environment: str) -> Generator[int, None, None]:
    """Run a worker that has come to a scheduler's knowledge; give its process, which is that of its nanny."""
    from distributed import Client

    command = ["worker", address, "--host", "127.0.0.1", "--nthreads", str(threads), "--no-dashboard"]
    command += ["--memory-limit", "0", "--local-directory", str(folder)]
    with Client(address, set_as_default=False) as client:
        there = len(cast("dict[str, int]", client.nthreads()))
        with running(folder, *command, **environment) as process:
            client.wait_for_workers(there + 1, timeout=300)
            yield process.pid


def closed_port() -> int:
    """Return a port at which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]
