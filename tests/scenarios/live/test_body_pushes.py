"""Pushes of several pages: each ends with its page, or as that is silent."""

import asyncio
import time

from handover.scenarios.live.body_pushes import BodyPushes
from handover.scenarios.live.commands import Push
from handover.scenarios.robots.free_flyer.robot_wiring import PUSHES_WITH_JOINTS

NONE, POINT = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)
ROBOT, GRIPPER = PUSHES_WITH_JOINTS


class Bodies(dict[tuple[str, ...], tuple[float, ...]]):
    """The force on each body."""

    def apply(self, push: Push) -> None:
        self[push.body.labels] = push.force


def test_a_page_pushes_one_body_at_a_time_and_as_it_lets_go_leaves_the_push_of_another_one():
    async def act() -> None:
        pushes, forces = BodyPushes(60.0), Bodies()
        pushes.hold("A", Push(ROBOT, (1.0, 0.0, 0.0), POINT), forces.apply)
        pushes.hold("B", Push(GRIPPER, (2.0, 0.0, 0.0), POINT), forces.apply)
        assert forces == {ROBOT.labels: (1.0, 0.0, 0.0), GRIPPER.labels: (2.0, 0.0, 0.0)}
        pushes.hold("A", Push(GRIPPER, (3.0, 0.0, 0.0), POINT), forces.apply)
        assert forces == {ROBOT.labels: NONE, GRIPPER.labels: (3.0, 0.0, 0.0)}
        pushes.release("A")
        assert forces[GRIPPER.labels] == (2.0, 0.0, 0.0)
        assert ("A" in pushes, "B" in pushes) == (False, True)
        pushes.release_all()
        assert set(forces.values()) == {NONE}

    asyncio.run(act())


def test_a_silent_page_pushes_no_more_and_one_that_speaks_does_and_one_unheard_while_the_server_was_busy():
    async def act() -> None:
        pushes, forces = BodyPushes(0.2), Bodies()
        pushes.hold("silent", Push(ROBOT, (1.0, 0.0, 0.0), POINT), forces.apply)
        while "silent" in pushes:
            pushes.hold("speaking", Push(GRIPPER, (2.0, 0.0, 0.0), POINT), forces.apply)
            await asyncio.sleep(0.0)
        assert forces == {ROBOT.labels: NONE, GRIPPER.labels: (2.0, 0.0, 0.0)}
        time.sleep(0.5)  # it is busy
        for _ in range(3):
            await asyncio.sleep(0.0)
        assert "speaking" in pushes  # what the page has sent meanwhile is yet to be read
        while "speaking" in pushes:
            await asyncio.sleep(0.0)
        assert forces[GRIPPER.labels] == NONE

    asyncio.run(act())
