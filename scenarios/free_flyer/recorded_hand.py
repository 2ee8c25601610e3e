"""The hand's track of a run, as a file by which it can be led again."""

from pathlib import Path

from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.hand_track import HandPose, write_track

_SIGNALS = ("p_WH_goal", "q_WH_goal", "finger_goal", "closed_goal")


class NoHand(ValueError):
    """A record has no hand of the free-flyer's person."""


def write_hand_track(record: Record, path: Path, unit: str = "person") -> int:
    """Write where person or tracker wanted the hand in a run, without what arm and object made of it.

    Args:
        record: of a run with a `HandAndObject`.
        path: of the file, CSV, in the form of `HandAndObject`'s parameter track.
        unit: its name in the system.

    Returns:
        The number of its rows.

    Raises:
        NoHand: the run has no such signals.
    """
    lacking = [name for name in _SIGNALS if f"{unit}.{name}" not in record]
    if lacking:
        raise NoHand(
            f"the run has no {', '.join(f'{unit}.{name}' for name in lacking)}; a handover of the free-flyer has"
        )
    p, q, angles, closed = (record[f"{unit}.{name}"].tolist() for name in _SIGNALS)
    poses = (HandPose(tuple(a), tuple(b), tuple(c), bool(d)) for a, b, c, d in zip(p, q, angles, closed, strict=True))
    write_track(path, zip(record.time.tolist(), poses, strict=True))
    return len(record.time)
