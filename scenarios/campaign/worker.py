"""What a worker of a Dask cluster does for a campaign: functions that the campaign's process calls there.

A worker's threads carry out a run each, by a run server of their own.
"""

import functools
import os
import threading
from collections.abc import Mapping
from pathlib import Path

from distributed import get_worker

from handover.scenarios.campaign.run_order import RunAnswer, RunOrder
from handover.scenarios.campaign.server_process import NotWanted, ServerLost, ServerProcess
from handover.scenarios.results.run_folder import version_differences, versions

_servers: dict[tuple[str, int], ServerProcess] = {}
"""By batch and thread."""

_ended: set[str] = set()
"""Batches whose runs are not wanted any more."""

_lock = threading.Lock()


def carry_out_run(order: RunOrder, batch: str, wanted_versions: Mapping[str, str]) -> RunAnswer:
    """Carry out an order of a batch. If its server dies, begin it anew with another one, once.

    A worker that came when the others had been checked may be of other versions; it carries out nothing.
    """
    worker = get_worker()
    if other := difference(wanted_versions, _versions()):
        return RunAnswer(name=order.name, lost=f"worker {worker.address} {other}")
    task = worker.get_current_task()

    def wanted() -> bool:
        known = worker.state.tasks.get(task)
        return batch not in _ended and known is not None and known.state in ("executing", "long-running")

    lost = ""
    for _ in range(2):
        try:
            return _server_of(batch).carry_out(order, wanted)
        except ServerLost as e:
            lost = str(e)
        except NotWanted:
            lost = "it was ended, as nobody waited for it"
        if not wanted():
            break
    return RunAnswer(name=order.name, lost=lost)


def end_runs(batch: str) -> None:
    """End the runs of a batch in this worker, and its servers."""
    with _lock:
        _ended.add(batch)
        servers = [_servers.pop(key) for key in list(_servers) if key[0] == batch]
    for server in servers:
        server.ask_to_end()
    for server in servers:
        server.end()


def tell_versions() -> dict[str, str]:
    """Return the versions of what a run's numbers depend on."""
    return _versions()


_versions = functools.cache(versions)


def difference(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return what other versions a worker has, "" if it has none."""
    other = version_differences(here, there)
    return f"has other versions: {other}" if other else ""


def fault_of_folder(folder: str, file: str, content: str) -> str:
    """Return why this worker cannot write to a folder in which the campaign has written a file, "" if it can."""
    try:
        if Path(folder, file).read_text(encoding="utf-8") != content:
            return "it sees another folder of that name"
    except OSError as e:
        return f"it does not see what is written there ({e.strerror})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it may not write there"


def _server_of(batch: str) -> ServerProcess:
    """Return this thread's server, started unless it lives.

    Raises:
        NotWanted: the batch is ended: orders that waited here come until the scheduler has taken them back.
    """
    key = batch, threading.get_ident()
    with _lock:
        if batch in _ended:
            raise NotWanted
        server = _servers.get(key)
        if server is None or not server.lives:
            server = _servers[key] = ServerProcess()
    return server
