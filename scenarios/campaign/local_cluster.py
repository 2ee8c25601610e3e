"""Worker pools on Dask: starts workers on this machine's cores, or connects to a cluster that the user runs."""

import contextlib
import logging
import os
import signal
import sys
import warnings
from collections.abc import Generator
from multiprocessing import resource_tracker

from dask import config
from distributed import Client, LocalCluster

from handover.cosim.exceptions import one_line
from handover.cosim.python_process import SAFE_PATH, environment_changed
from handover.scenarios.campaign.cluster import ClusterPool
from handover.scenarios.campaign.worker_pool import cores
from handover.scenarios.execution.errors import PoolError

_SILENT = logging.CRITICAL + 1
_LOGGERS = ("distributed", "distributed.client", "distributed.gc", "tornado", "tornado.application", "asyncio")
_FIRST_WORKER_TIMEOUT = 3.0
"""How long is waited for a cluster's first worker, s."""

_SETTINGS = {
    "distributed.scheduler.allowed-failures": 3,
    "distributed.comm.timeouts.connect": "5s",
    "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": str(_SILENT),
    **{f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in SAFE_PATH.items()},
}

_NO_MONITORING = {
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.client.scheduler-info-interval": "10s",
}
"""Keeps workers from measuring themselves many times a second for a dashboard that nobody opens."""


@contextlib.contextmanager
def local_cluster(workers: int | None) -> Generator[ClusterPool, None, None]:
    """Start workers on this machine, a process each; by default one for each core that this process may use.

    They receive no Ctrl-C, end with this process, however it ends, and listen on the loopback interface alone.

    Raises:
        PoolError: they cannot be started.
    """
    with _quiet(), config.set({**_SETTINGS, **_NO_MONITORING}), contextlib.ExitStack() as opened:
        try:
            # threads and processes started here inherit both
            with _environment_of_resource_tracker(), _ignore_ctrl_c():
                cluster = LocalCluster(
                    n_workers=workers or cores(),
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",  # by default it listens on all interfaces
                    memory_limit=0,
                    silence_logs=_SILENT,
                )
                opened.callback(cluster.close)
                client = opened.enter_context(Client(cluster, set_as_default=False))
        except (OSError, RuntimeError) as e:
            raise PoolError(f"no workers can be started on this machine: {one_line(e)}") from e
        pool = ClusterPool(client, "the cluster on this machine")
        opened.callback(pool.end)
        yield pool


@contextlib.contextmanager
def connect_cluster(address: str) -> Generator[ClusterPool, None, None]:
    """Connect to a cluster that the user runs; the address is one that `scheduler_address` has returned.

    Raises:
        PoolError: no scheduler answers there, or it has no workers.
    """
    with _quiet(), config.set(_SETTINGS), contextlib.ExitStack() as opened:
        try:
            client = opened.enter_context(Client(address, timeout=5, set_as_default=False))
        except (OSError, ValueError) as e:
            raise PoolError(f"the scheduler at {address} cannot be used: {one_line(e)}") from e
        try:
            client.wait_for_workers(1, timeout=_FIRST_WORKER_TIMEOUT)
        except TimeoutError as e:
            raise PoolError(f"the scheduler at {address} has no workers; `dask worker {address}` starts some") from e
        pool = ClusterPool(client, f"the cluster at {address}")
        opened.callback(pool.end)
        yield pool


@contextlib.contextmanager
def _quiet() -> Generator[None, None, None]:
    """Keep Dask's own log and warnings off the terminal: `PoolError` and job results report what matters."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    before = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # such as that versions of Dask's packages differ
        for logger in loggers:
            logger.setLevel(_SILENT)
        try:
            yield
        finally:
            for logger, level in zip(loggers, before, strict=True):
                logger.setLevel(level)


@contextlib.contextmanager
def _environment_of_resource_tracker() -> Generator[None, None, None]:
    """Let Python's resource tracker, a process that cleans up after a killed command, do so without warnings.

    Nor does it import modules from the working directory.
    """
    warned = filter(None, [os.environ.get("PYTHONWARNINGS"), "ignore:resource_tracker:UserWarning"])
    changed = {"PYTHONWARNINGS": ",".join(warned), **SAFE_PATH}
    with environment_changed(changed):
        yield


@contextlib.contextmanager
def _ignore_ctrl_c() -> Generator[None, None, None]:
    """Let threads and processes that are started meanwhile receive no Ctrl-C, which this thread handles."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its start unblocks Ctrl-C in the starting thread
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
