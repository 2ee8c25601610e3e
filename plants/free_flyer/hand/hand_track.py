"""A recorded track of a person's hand, as a hand tracker gives it: a table of times, poses and joint angles (CSV)."""

import csv
import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.plain_rotation import Quaternion, Vector, lerp, nlerp, normalize
from handover.cosim.files import read_csv, reading_fault
from handover.plants.free_flyer.hand.hand_kinematics import JOINT_MAX, JOINTS

COLUMNS = (
    "t",
    *(f"p_{axis}" for axis in "xyz"),
    *(f"q_{axis}" for axis in "wxyz"),
    *(f"joint_{i}" for i in range(1, JOINTS + 1)),
    "closed",
)
"""Of a track: time, s; position of H in W, m; orientation, scalar first; 14 joints, rad; 1 where the hand grasps."""

_NAMED = 3
"""How many rows a fault names."""
_UNIT = 1e-3
"""How far a quaternion's norm may be from 1."""
_SAME_TIME = 1e-9
"""Seconds by which a row's time may be later than a given time, by rounding, and still be reached."""
_ROUNDING = 1e-6
"""Radians by which a joint may be beyond its range, by rounding."""


class HandPose(NamedTuple):
    """Where a hand is to be: H in W, m and scalar first; angles of its joints, rad; whether it grasps."""

    p: Vector
    q: Quaternion
    angles: tuple[float, ...]
    closed: bool


class InvalidTrack(InvalidParameters):
    """A track that cannot be followed; `faults` lists what is wrong, with its file, lines, and what would be right."""

    block = "HandAndObject"

    def __init__(self, path: Path, faults: Sequence[str]) -> None:
        super().__init__([f"track {path}: {fault}" for fault in faults])
        self.path = path


class HandTrack:
    """Poses over time: between rows positions are interpolated linearly, orientations by nlerp; `closed` holds on.

    Before its first row and after its last the hand is to be where they say.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[HandPose]) -> None:
        self._times, self._poses = tuple(times), tuple(poses)

    @property
    def times(self) -> tuple[float, ...]:
        """Times of its rows, s, which increase."""
        return self._times

    @property
    def poses(self) -> tuple[HandPose, ...]:
        """Where the hand is to be at these times."""
        return self._poses

    def at(self, t: float) -> HandPose:
        """Return where the hand is to be at a time, s."""
        i = bisect_right(self._times, t + _SAME_TIME)
        if i == 0 or i == len(self._times):
            return self._poses[max(0, i - 1)]
        a, b = self._poses[i - 1], self._poses[i]
        s = max(t - self._times[i - 1], 0.0) / (self._times[i] - self._times[i - 1])
        angles = tuple(x + s * (y - x) for x, y in zip(a.angles, b.angles, strict=True))
        return HandPose(lerp(a.p, b.p, s), nlerp(a.q, b.q, s), angles, a.closed)


def read_track(path: Path, max_gap: float) -> HandTrack:
    """Return the track in a file.

    Args:
        path: a CSV file with the columns `COLUMNS`, in any order.
        max_gap: longest time between two rows, s.

    Raises:
        InvalidTrack: it cannot be read, lacks columns or names one twice, or rows are not numbers, before 0 s, not in
            the order of time, too far apart, or hold a quaternion that is not a rotation or a joint beyond 0 to 90
            degrees.
    """
    try:
        table = [(n, row) for n, row in read_csv(path) if row]
    except OSError as e:
        raise InvalidTrack(path, [reading_fault(e)]) from e
    except ValueError as e:
        raise InvalidTrack(path, [f"it cannot be read: {e}"]) from e
    header = [name.strip() for name in table[0][1]] if table else []
    if fault := _fault_of_header(header):
        raise InvalidTrack(path, [fault])
    at = [header.index(name) for name in COLUMNS]
    rows = [(n, _numbers(row, at)) for n, row in table[1:]]
    if not rows:
        raise InvalidTrack(path, ["it has no rows below its header"])
    faults = _faults(rows, max_gap)
    if faults:
        raise InvalidTrack(path, faults)
    return HandTrack([row[0] for _, row in rows], [_pose(row) for _, row in rows])


def write_track(path: Path, rows: Iterable[tuple[float, HandPose]]) -> None:
    """Write times and poses as a file that `read_track` reads, to the last digit."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for t, pose in rows:
            writer.writerow([repr(float(x)) for x in (t, *pose.p, *pose.q, *pose.angles)] + [int(pose.closed)])


def _fault_of_header(header: Sequence[str]) -> str:
    """Return what is wrong with the names in the first row of a table, "" if nothing is."""
    if not header:
        return "it is empty"
    lacking = [name for name in COLUMNS if name not in header]
    if not lacking:
        twice = [name for name in COLUMNS if header.count(name) > 1]
        return f"its first row names {', '.join(twice)} more than once" if twice else ""
    needed = f"its first row must name all of {', '.join(COLUMNS)}, separated by commas"
    if len(lacking) == len(COLUMNS):
        return f"{needed}; it names none of them"
    return f"{needed}; lacking: {', '.join(lacking)}"


def _numbers(row: Sequence[str], at: Sequence[int]) -> list[float]:
    """Return a row's numbers in the order of COLUMNS, NaN for what is none."""
    return [_number(row[i]) if i < len(row) else math.nan for i in at]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _pose(row: Sequence[float]) -> HandPose:
    x, y, z, q_w, q_x, q_y, q_z = row[1:8]
    angles = tuple(min(max(angle, 0.0), JOINT_MAX) for angle in row[8 : 8 + JOINTS])
    return HandPose((x, y, z), normalize((q_w, q_x, q_y, q_z)), angles, row[-1] > 0.5)


def _faults(rows: Sequence[tuple[int, Sequence[float]]], max_gap: float) -> list[str]:
    """Return what is wrong with rows, given with their line numbers."""
    found: dict[str, list[str]] = {}

    def add(what: str, n: int, value: str) -> None:
        found.setdefault(what, []).append(f"{n} ({value})")

    before: float | None = None
    for n, row in rows:
        t, norm = row[0], math.hypot(*row[4:8])
        broken = [name for name, x in zip(COLUMNS, row, strict=True) if not math.isfinite(x)]
        if broken:
            add("every entry must be a finite number", n, ", ".join(broken))
        if math.isfinite(norm) and abs(norm - 1.0) > _UNIT:
            add("a quaternion must have the norm 1", n, f"norm {norm:.4g}")
        beyond = [f"{name} {x:.4g}" for name, x in zip(COLUMNS[8:-1], row[8:-1], strict=True) if _is_beyond(x)]
        if beyond:
            add(f"joints must be within 0 and {JOINT_MAX:.4f} rad", n, ", ".join(beyond))
        if math.isfinite(row[-1]) and row[-1] not in (0.0, 1.0):
            add("closed must be 0 or 1", n, f"{row[-1]:g}")
        if not math.isfinite(t):
            continue
        if t < 0.0:
            add("time must not be negative, a run begins at 0 s", n, f"{t:g} s")
        if before is not None and t <= before:
            add("time must increase", n, f"{t:g} s after {before:g} s")
        elif before is not None and t - before > max_gap * (1.0 + 1e-9):
            add(f"rows must be {max_gap:g} s apart at most", n, f"{t - before:.3g} s after the row before")
        before = t
    return [f"{what}: {_listed(where)}" for what, where in found.items()]


def _is_beyond(angle: float) -> bool:
    return angle < -_ROUNDING or angle > JOINT_MAX + _ROUNDING


def _listed(where: Sequence[str]) -> str:
    more = len(where) - _NAMED
    return f"line {', '.join(where[:_NAMED])}" + (f" and {more} more" if more > 0 else "")
