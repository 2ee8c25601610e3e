"""Pushes of several pages: each ends with its page, or as that is silent."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from handover.scenarios.free_flyer.robot_wiring import PUSHES_WITH_JOINTS
from handover.scenarios.live.body_pushes import BodyPushes
from handover.scenarios.live.commands import Push

NONE, POINT = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)
ROBOT, GRIPPER = PUSHES_WITH_JOINTS


class Bodies:
    """What acts on each body."""

    def __init__(self) -> None:
        self.forces: dict[tuple[str, ...], tuple[float, ...]] = {}

    def apply(self, push: Push) -> None:
        self.forces[push.body.labels] = push.force


def played(act: Callable[[BodyPushes, Bodies], Awaitable[None]], silence: float = 60.0) -> None:
    async def work() -> None:
        await act(BodyPushes(silence), Bodies())

    asyncio.run(work())


def test_a_page_that_lets_go_leaves_the_push_of_another_one():
    async def act(pushes: BodyPushes, bodies: Bodies) -> None:
        pushes.hold("A", Push(ROBOT, (1.0, 0.0, 0.0), POINT), bodies.apply)
        pushes.hold("B", Push(GRIPPER, (2.0, 0.0, 0.0), POINT), bodies.apply)
        pushes.release("A")
        assert bodies.forces == {ROBOT.labels: NONE, GRIPPER.labels: (2.0, 0.0, 0.0)}
        assert ("A" in pushes, "B" in pushes) == (False, True)
        pushes.hold("A", Push(GRIPPER, (3.0, 0.0, 0.0), POINT), bodies.apply)
        pushes.release("A")
        assert bodies.forces[GRIPPER.labels] == (2.0, 0.0, 0.0)
        pushes.release("B")
        assert bodies.forces[GRIPPER.labels] == NONE

    played(act)


def test_a_page_pushes_one_body_at_a_time():
    async def act(pushes: BodyPushes, bodies: Bodies) -> None:
        pushes.hold("A", Push(ROBOT, (1.0, 0.0, 0.0), POINT), bodies.apply)
        pushes.hold("A", Push(GRIPPER, (2.0, 0.0, 0.0), POINT), bodies.apply)
        assert bodies.forces == {ROBOT.labels: NONE, GRIPPER.labels: (2.0, 0.0, 0.0)}
        pushes.release_all()
        assert set(bodies.forces.values()) == {NONE}

    played(act)


def test_a_silent_page_pushes_no_more_and_one_that_speaks_does():
    async def act(pushes: BodyPushes, bodies: Bodies) -> None:
        pushes.hold("silent", Push(ROBOT, (1.0, 0.0, 0.0), POINT), bodies.apply)
        while "silent" in pushes:
            pushes.hold("speaking", Push(GRIPPER, (2.0, 0.0, 0.0), POINT), bodies.apply)
            await asyncio.sleep(0.0)
        assert bodies.forces == {ROBOT.labels: NONE, GRIPPER.labels: (2.0, 0.0, 0.0)}

    played(act, silence=0.2)


def test_a_push_is_held_once_more_where_the_server_was_busy(monkeypatch: pytest.MonkeyPatch):
    async def act(pushes: BodyPushes, bodies: Bodies) -> None:
        pushes.hold("A", Push(ROBOT, (1.0, 0.0, 0.0), POINT), bodies.apply)
        loop = asyncio.get_running_loop()
        timers: list[Callable[[], object]] = []

        def caught(_delay: float, callback: Callable[..., object], *args: Any) -> asyncio.Handle:
            timers.append(lambda: callback(*args))
            return asyncio.Handle(callback, args, loop)

        monkeypatch.setattr(loop, "call_later", caught)
        pushes._release_silent("A", loop.time() - 1.0)  # type: ignore
        assert "A" in pushes  # what the page has sent meanwhile is yet to be read
        (again,) = timers
        again()  # late once more or not
        assert "A" not in pushes
        assert bodies.forces == {ROBOT.labels: NONE}

    played(act)
