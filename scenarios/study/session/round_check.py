"""Whether a round's record is what its recorded inputs give: the run is carried out again, and compared byte for byte.

A round that anybody has changed afterwards does not stand this, nor one whose simulation was not repeatable.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.files import scratch_folder
from handover.cosim.record.reader import Record
from handover.scenarios.runs.execution.input_sources import played_back
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.request import RunRequest
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_facts import elements_of, whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder, version_differences, versions
from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.plan.led_hands import round_parameters
from handover.scenarios.study.plan.order import Round


@dataclass(frozen=True)
class RoundCheck:
    """What came of it.

    Attributes:
        signals, rows: how many were compared.
        difference: the first in time, in words; None where all is the same.
        other_versions: what has recorded the round and is another version here; "" if nothing is.
    """

    signals: int
    rows: int
    difference: str | None
    other_versions: str


def check_round(session: SessionFolder, planned: Round) -> RoundCheck:
    """Carry a round out again, with its condition and seed of the plan and its recorded inputs, in a folder of its own.

    Raises:
        InvalidRunFolder: the round has no record, or one without its inputs.
        UsageError, InvalidParameter, CosimError: it cannot be run here.
    """
    run = RunFolder.of_run(session.run_folder(planned.number))
    if not run.is_there or run.read_summary().get("complete") is False:
        raise InvalidRunFolder(run.path, "it has no record of a round that was played to its end")
    recorded = _record(run)
    condition = planned.condition
    with scratch_folder("study") as scratch, contextlib.ExitStack() as opened:
        again = scratch / "again"
        request = RunRequest(
            subject=condition.scenario,
            parameters=round_parameters(condition),
            seed=planned.seed,
            out=again,
            presented=False,
            sources=played_back(run.path),
        )
        with Interruption() as interruption:
            run_task(request.task(opened), lambda _t, _end: None, interruption)
            if interruption.asked:
                raise KeyboardInterrupt
        repeated = _record(RunFolder.of_run(again))
        difference = first_difference(recorded, repeated)
    there: Mapping[str, str] = run.read_run().get("versions") or {}
    return RoundCheck(len(recorded.signals), len(recorded.time), difference, version_differences(versions(), there))


def _record(run: RunFolder) -> Record:
    record = whole_record_of(run)
    if record is None:
        raise InvalidRunFolder(run.path, "it has no record")
    return record


def first_difference(recorded: Record, repeated: Record) -> str | None:
    """Return the first difference of two records in time: its signal, time and both values; None if there is none."""
    for names, where in (
        ([s for s in recorded.signals if s not in repeated], "the record alone"),
        ([s for s in repeated.signals if s not in recorded], "the repeated run alone"),
    ):
        if names:
            return f"{', '.join(names)}: in {where}"
    common = min(len(recorded.time), len(repeated.time))
    ones = {name: recorded[name][:common] for name in ("time", *recorded.signals)}
    others = {name: repeated[name][:common] for name in ones}
    rows = {name: k for name in ones if (k := _first_row(ones[name], others[name])) is not None}
    if rows:
        name = min(rows, key=lambda n: rows[n])
        k = rows[name]
        element, one, other = _element(name, ones[name][k : k + 1], others[name][k : k + 1])
        return f"{element} at {float(recorded.time[k])!r} s: {one!r} in the record, {other!r} in the repeated run"
    if len(recorded.time) != len(repeated.time):
        return f"the end: at {recorded.time[-1]:g} s in the record, at {repeated.time[-1]:g} s in the repeated run"
    return None


def _first_row(ones: NDArray[Any], others: NDArray[Any]) -> int | None:
    """Return the first row in which the bytes of two arrays of numbers differ; None if there is none."""
    if ones.dtype != others.dtype or ones.shape != others.shape:
        return 0
    differ = (_bytes(ones) != _bytes(others)).any(axis=1)
    return int(np.argmax(differ)) if differ.any() else None


def _bytes(values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(values).reshape(len(values), -1).view(np.uint8)


def _element(name: str, one: NDArray[Any], other: NDArray[Any]) -> tuple[str, Any, Any]:
    """Return the first element of a signal that differs in a row, by its name in the record, with both values."""
    found, there = elements_of(name, one), elements_of(name, other)
    for element in found:
        if element in there and _first_row(found[element], there[element]) is not None:
            return element, found[element][0].item(), there[element][0].item()
    return name, one[0].tolist(), other[0].tolist()
