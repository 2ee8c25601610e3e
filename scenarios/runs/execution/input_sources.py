"""Who gives values to the inputs of a run from outside: a run that was recorded, a page, or a program."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.exceptions import nearest
from handover.cosim.system.system import PortName, System
from handover.cosim.system.time_series import ExternalSource, TimeSeries
from handover.scenarios.experiment.live_inputs import LedHand, Pushable
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder, sha256_of
from handover.scenarios.runs.results.task import InputSources


def played_back(path: Path) -> InputSources:
    """Return the inputs from outside of a recorded run, to be given to another.

    Raises:
        InvalidRunFolder: it is not the folder of a run, the run had no inputs from outside, or its record lacks them.
    """
    folder = RunFolder.of_run(path)
    names = recorded_input_names(folder)
    record = whole_record_of(folder)
    if not names:
        raise InvalidRunFolder(path, "the run had no inputs from outside that could be played back")
    if record is None or not len(record.time):
        raise InvalidRunFolder(path, "it has no record of its inputs from outside")
    if lacking := [name for name in names if name not in record]:
        raise InvalidRunFolder(path, f"its record lacks inputs from outside: {', '.join(lacking)}")
    until = float(record.time[-1])
    origin = {"from": "run", "folder": str(folder.path), "sha256": sha256_of(folder.signals), "until": until}
    series = {name: record.series(name) for name in names}
    return InputSources(series, origin, where=f"inputs from {path}", is_complete=True)


def recorded_input_names(folder: RunFolder) -> Sequence[str]:
    """Return the names of the inputs that came from outside in a run.

    Raises:
        InvalidRunFolder: it is not the folder of a run, or its run.json is damaged.
    """
    return folder.read_run().get("external_inputs", [])


def resumed_inputs(
    folder: RunFolder, origin: Mapping[str, Any] | None, pushes: Sequence[Pushable] = (), hand: LedHand | None = None
) -> InputSources | None:
    """Return the sources of a run that is resumed, by what its folder tells of them.

    What a page gave is taken from the record as far as that goes. From then on nobody pushes, and the hand that was led
    stays as its last sample says, which grows old.

    Args:
        folder: the run's, its record complete as far as it goes.
        origin: what it tells of its sources; None if nobody gave values.
        pushes: bodies of the scenario that can be pushed.
        hand: the hand of the scenario that is led.

    Raises:
        InvalidRunFolder: they are gone: the run that was played back is not what it was, or a program gave them.
    """
    if origin is None:
        return None
    if origin.get("from") == "page":
        recorded, names = whole_record_of(folder), recorded_input_names(folder)
        lacking = [name for name in names if recorded is None or name not in recorded]
        if recorded is None or lacking:
            raise InvalidRunFolder(folder.path, f"its record lacks what its page gave: {', '.join(lacking)}")
        series = {name: recorded.series(name) for name in names}
        forces = {f"{push.unit}.{push.force}" for push in pushes}
        age = "" if hand is None else hand.age
        end = float(recorded.time[-1])
        sources = {name: _Recorded(one, is_force=name in forces, is_age=name == age) for name, one in series.items()}
        return InputSources(sources, {**origin, "until": min(end, float(origin.get("until", end)))})
    if origin.get("from") != "run":
        text = f"its inputs came from outside, from a {origin.get('from')}, which is gone"
        instead = f"begin it once more with --inputs-from {folder.path}, which gives it those that it recorded"
        raise InvalidRunFolder(folder.path, f"{text}; {instead}")
    sources = played_back(Path(origin["folder"]))
    if sources.origin != {**sources.origin, **origin}:
        raise InvalidRunFolder(folder.path, f"the record of {origin['folder']}, whose inputs it took, is another one")
    return sources


class _Recorded:
    """Gives an input of a page that is gone: what was recorded, and after that what holds with nobody there.

    Args:
        series: what was recorded.
        is_force: whether it is a force, which then ceases; all else holds.
        is_age: whether it is how old a sample is, which then grows.
    """

    def __init__(self, series: TimeSeries, *, is_force: bool, is_age: bool) -> None:
        self._series, self._is_force, self._is_age = series, is_force, is_age

    def at(self, t: float) -> NDArray[Any]:
        """Return the entries for the communication point at t, s."""
        entries = self._series.at(t)
        after = t - float(self._series.times[-1])
        if after <= 0.0:
            return entries
        return np.zeros_like(entries) if self._is_force else entries + after if self._is_age else entries


def give_inputs(system: System, inputs: InputSources | None) -> None:
    """Let sources give values to inputs of a system from outside.

    Raises:
        UsageError: the system does not take them so, with all that is wrong.
    """
    if inputs is None:
        return
    own = external_inputs(system)
    unknown = [name for name in inputs.sources if name not in own]
    faults = [_fault_of_unknown(unknown, own, inputs.origin)] if unknown else []
    faults += [fault for name, end in own.items() if (fault := _fault(system, end, inputs.sources.get(name)))]
    if inputs.is_complete:
        lacking = [name for name in own if name not in inputs.sources]
        faults += [f"{name}: comes from outside in this run, and did not in the recorded one" for name in lacking]
    if faults:
        raise UsageError(f"{inputs.where}: {'; '.join(faults)}")
    for name, source in inputs.sources.items():
        system.external(own[name], source)


def external_inputs(system: System) -> dict[str, PortName]:
    """Return the inputs of a system that come from outside, by `unit.input`."""
    return {str(end): end for end in system.externals}


def _fault_of_unknown(names: Sequence[str], own: Mapping[str, PortName], origin: Mapping[str, Any]) -> str:
    """Return what is wrong with values for inputs that do not come from outside, and what would be right."""
    parts = [f"{', '.join(names)}: this run takes no values from outside for {'it' if len(names) == 1 else 'them'}"]
    if own:
        parts += [nearest(name, own) for name in names]
    if origin.get("from") == "run":
        parts.append(f"with which parameters the recorded run takes them is in {Path(origin['folder']) / 'run.json'}")
    return "; ".join(parts)


def _fault(system: System, end: PortName, source: ExternalSource | None) -> str | None:
    """Return why an input from outside does not take values from a source, if it is given one."""
    port = system.units[end.unit].description.inputs.get(end.port)
    fault = source.fault(port) if isinstance(source, TimeSeries) and port is not None else None
    return None if fault is None else f"{end.unit}.{end.port}: {fault}"
