"""A participant's practice: how much of it is over, the device's test in it, and when its object is out of reach."""

import numpy as np

from handover.cosim.record.reader import Record
from handover.scenarios.study.folder.session_folder import SessionFolder
from handover.scenarios.study.plan.led_hands import led_hand_of
from handover.scenarios.study.session.device_test import DeviceTest
from handover.scenarios.study.session.trial import Trial

PRACTICE = "handover.scenarios.robots.free_flyer.handover.hand_practice:HandPractice"
_LOST_FROM = 0.7
"""How far from its first place the object of the practice is lost, m; the practice then begins anew (assumed)."""
_SHORTEST = 1.0
"""Practice that is left and not begun any more, s."""


class Practice:
    """The practice of one session, which may go on over several runs.

    Args:
        session: whose it is.

    Attributes:
        session: likewise.
        done: simulated time that was practised in runs that have ended, s.
        test: of the device.
    """

    def __init__(self, session: SessionFolder) -> None:
        self.session = session
        self.done = 0.0
        self.test = DeviceTest(session.session.device, led_hand_of(PRACTICE, ()))

    @property
    def left(self) -> float:
        """Simulated time that is left, s."""
        return self.session.plan.practice - self.done

    @property
    def goes_on(self) -> bool:
        """Whether there is time left for one more run."""
        return self.left > _SHORTEST

    @property
    def parameters(self) -> list[str]:
        """Those of its next run."""
        return [f"duration={max(_SHORTEST, self.left)!r}"]

    def count(self, row: Record | None) -> None:
        """Count a run that has ended, by its last row."""
        self.done += 0.0 if row is None else float(row.time[0])

    def observe(self, row: Record) -> bool:
        """Take in the run under way; return whether something else is asked for than before."""
        return self.test.observe(self.done + float(row.time[0]), row)

    @property
    def shown(self) -> dict[str, object]:
        """What is kept of it."""
        return {"practised": round(self.done, 3), **self.test.shown}


def is_lost(trial: Trial) -> bool:
    """Return whether the object of the practice is where no hand can get it."""
    row = trial.newest
    if row is None or trial.first_place is None:
        return False
    return float(np.linalg.norm(row[f"{trial.led.unit}.p_WO"][0] - trial.first_place)) > _LOST_FROM
