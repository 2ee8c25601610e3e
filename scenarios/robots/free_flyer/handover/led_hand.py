"""A recorded hand, or one from outside, in the place of a simulated person: what leads it, and what it must be."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.system import System
from handover.plants.free_flyer.hand.hand_track import HandTrack, InvalidTrack, read_track
from handover.plants.free_flyer.hand.parameters import OF_PERSON, Driver, Params
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.parameters import Hand, HandoverParameters

NEVER_TRACKED = 1e6
"""Age of tracking that never began, s: more than any limit."""
_PERSON = ("person", "PERSON", int(Driver.PERSON))
_FASTEST = 10.0
"""Speed of a hand, m/s, above which its track is taken for broken (assumed): a fast reach makes about 5 m/s."""
_MILLIMETRES = 10.0
"""Metres from which positions are taken for millimetres, if they are within reach as such (assumed)."""


def leader(p: HandoverParameters, stop: float) -> dict[str, Any]:
    """Return what leads the hand, as start values of the person's unit: none of them if it is a simulated person.

    A track's path is absolute, since a unit may run in another folder. Where nothing comes from outside, the tracking
    is lost from the start.

    Args:
        p: the scenario's parameters.
        stop: when a run ends at the latest, s.

    Raises:
        InvalidParameter: the track cannot be followed, no handover can be made of it, or two are to lead the hand.
    """
    if not p.is_led:
        return {}
    path = Path(p.hand_track).absolute()
    if p.hand is Hand.OUTSIDE:
        if p.hand_track:
            raise InvalidParameter(["hand_track: a track leads the hand, or hand=outside does: give one of them"])
        return {"driven_by": "outside", "age": NEVER_TRACKED}
    if faults := _faults_of_file(path, stop):
        raise InvalidParameter(faults)
    return {"driven_by": "track", "track": str(path)}


def _faults_of_file(path: Path, stop: float) -> list[str]:
    """Return why a track cannot be followed, or no handover can be made of it."""
    try:
        track = read_track(path, Params().age_max)
    except InvalidTrack as e:
        return [f"hand_track: {fault}" for fault in e.faults]
    return [f"hand_track: track {path}: {fault}" for fault in _faults(track, stop)]


def faults_of_person(system: System, given: Sequence[str]) -> list[str]:
    """Return what is wrong with given `UNIT.NAME` that only a simulated person has, where there is none.

    Only a unit that knows `driven_by` can be led by anything else.
    """
    person = system.units.get("person")
    if person is None or person.start.get("driven_by", Driver.PERSON) in _PERSON:
        return []
    return [
        f"{name}: of a simulated person alone, and something else leads the hand: leave it out"
        for name in given
        if name in {f"person.{own}" for own in OF_PERSON}
    ]


def end_of_track(file: str) -> float | None:
    """Return when a track ends, s; None where there is none, or the file is no more."""
    try:
        return read_track(Path(file), Params().age_max).times[-1] if file else None
    except InvalidTrack:
        return None


def _faults(track: HandTrack, stop: float) -> list[str]:
    """Return why no handover can be made of a track."""
    faults: list[str] = []
    if len(track.times) == 1:
        faults.append("it has one row, and a hand that neither comes nor pulls; expected a row each 0.2 s or less")
    if track.times[0] >= stop:
        faults.append(f"it begins at {track.times[0]:g} s, and the run ends by {stop:g} s: let its times begin at 0 s")
    person = vars(Params())
    rest, reach = np.array(person["p_WH_0"]), float(person["arm_reach"])
    p_WH = np.array([pose.p for pose in track.poses])
    nearest = _nearest(p_WH, rest)
    if nearest > reach:
        at = ", ".join(f"{x:g}" for x in rest)
        text = f"its positions are never nearer than {nearest:.3g} m to ({at}) m in W, where a person's hand rests,"
        if nearest > _MILLIMETRES and _nearest(p_WH / 1000.0, rest) <= reach:
            unit = "; they look like millimetres, and must be metres"
        else:
            unit = ""
        faults.append(f"{text} and an arm reaches {reach:g} m from there{unit}")
    ways, times = np.linalg.norm(np.diff(p_WH, axis=0), axis=1), np.array(track.times)
    for k in np.flatnonzero(ways > _FASTEST * np.diff(times))[:1].tolist():
        way, dt, t = float(ways[k]), float(times[k + 1] - times[k]), float(times[k + 1])
        faults.append(
            f"the hand jumps by {way:.3g} m within {dt:.3g} s to its place at {t:g} s: no hand is faster than "
            f"{_FASTEST:g} m/s"
        )
    if not any(pose.closed for pose in track.poses):
        faults.append("closed is 1 in none of its rows: the hand never holds anything")
    return faults


def _nearest(p_WH: Floats, rest: Floats) -> float:
    return float(np.min(np.linalg.norm(p_WH - rest, axis=1)))
