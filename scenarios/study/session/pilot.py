"""A scripted pilot: a program in the place of a person, which leads the hand by what the page shows, and by that alone.

It gets the same scene and the same states of the run as a page, waits for the signal light that is drawn in them, takes
the object or puts it into the gripper, and answers what is asked. What it rates are random numbers, which mean nothing.
"""

import asyncio
import base64
import json
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.scenarios.study.plan.plan import SCRIPT, StudyPlan

_SPEED = 0.35
"""How fast the hand is led, m/s."""
_READY, _HOLD, _OFFERED = 0.15, 0.07, 0.14
"""Place from which the hand comes at what it grasps; from an object's centre to where the hand holds it; from the
gripper to the hand that offers the object, along the object, m."""
_NEAR, _FAR = 0.012, 0.12
"""How near a place is reached, and how far from the object a hand does not have it, m."""
_REACTION = 0.3
"""Time from what is seen to what is done, s."""
_CLOSING = 0.5
"""Time for which a hand closes or opens before it moves on, s."""
_PULL, _PUSH = 0.06, 0.05
"""How far beyond its place the hand pulls and pushes, a second, m."""


class SeenScene:
    """Where things are that a page draws, from its scene and the states of the run that follow."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self._slots: list[tuple[str, int, str, slice]] = []
        self._meshes: dict[tuple[str, int], Floats] = {}
        at, count = 0, dict[str, int]()
        for trace in scene["traces"]:
            label = trace["label"]
            for part in trace.get("parts", [trace]):
                k = count[label] = count.get(label, -1) + 1
                if "vertices" in part:
                    self._meshes[label, k] = _unpacked(part["vertices"]).reshape(-1, 3)
                for key in ("points", "p", "q"):
                    if part.get(key):
                        size = 3 if trace.get("trail") else len(_unpacked(part[key]))
                        self._slots.append((label, k, key, slice(at, at + size)))
                        at += size
        self.time, self.stamp = 0.0, float("nan")
        self._places: Floats = np.zeros(at)

    def take(self, message: bytes) -> None:
        """Take in a state of the run."""
        numbers = np.frombuffer(message, dtype="<f8")
        self.time, self.stamp, self._places = float(numbers[0]), float(numbers[1]), numbers[2:]

    def place(self, label: str) -> Floats:
        """Return where a drawn body is, in W, m; not finite while it is hidden."""
        return self._of(label, 0, "p")

    def middle(self, label: str, part: int) -> Floats:
        """Return where the middle of a part of a drawn body is, in W, m."""
        return self._of(label, part, "p") + self.orientation(label, part) @ self._meshes[label, part].mean(axis=0)

    def orientation(self, label: str, part: int = 0) -> Floats:
        """Return a drawn body's orientation, as a rotation matrix."""
        return rotation_of(self._of(label, part, "q"))

    @property
    def light(self) -> bool:
        """Whether the light is on, which is drawn over its lamp."""
        return any(label == "signal light" for label, *_ in self._slots) and bool(
            np.isfinite(self._of("signal light", 1, "points")).all()
        )

    def _of(self, label: str, part: int, key: str) -> Floats:
        for of_label, of_part, of_key, where in self._slots:
            if (of_label, of_part, of_key) == (label, part, key):
                return self._places[where]
        raise KeyError(f"nothing is drawn of {label!r}, part {part}")


class ScriptedHand:
    """Leads the hand in a round: waits for the light, takes the object or gives it, and withdraws.

    Attributes:
        place: wanted, in W, m.
        closed: whether the hand is to be closed.
    """

    def __init__(self, scene: SeenScene) -> None:
        self._scene = scene
        self._rest = scene.place("hand")
        self._offset = np.zeros(3)
        self.place: Floats = self._rest.copy()
        self.closed = float(np.linalg.norm(scene.place("object") - self._rest)) < _FAR
        self._steps: list[Callable[[float], bool]] = []
        self._retreat: Floats | None = None  # where it backs off to, once it has given the object
        self._saw_light, self._signalled, self._since, self._time = False, False, 0.0, scene.time
        self._gap = 0.0

    def act(self, target: Mapping[str, Any] | None) -> None:
        """Do what the newest state of the run calls for; in the practice, go to the target that is shown."""
        scene = self._scene
        dt, self._time = max(0.0, scene.time - self._time), scene.time
        if target is not None:
            self._practise(dt, target)
            return
        light = scene.light
        self._signalled = self._signalled or (light and not self._saw_light)  # also while it still withdraws
        if self._signalled and not self._steps:
            self._since, self._signalled = 0.0, False
            self._gap = self._jaws_apart()
            self._retreat = None
            self._steps = self._giving() if self.closed else self._taking()
        self._saw_light = light
        self._since += dt
        if self._steps and self._steps[0](dt):
            self._steps.pop(0)
            self._since = 0.0

    def _taking(self) -> list[Callable[[float], bool]]:
        return [
            lambda _dt: self._since >= _REACTION,
            lambda dt: self._go(dt, self._object_end() - np.array([_READY, 0.0, 0.0])),
            lambda dt: self._go(dt, self._object_end()),
            lambda dt: self._close(dt, closed=True),
            self._pull,
            lambda dt: self._go(dt, self._rest),
        ]

    def _giving(self) -> list[Callable[[float], bool]]:
        return [
            lambda _dt: self._since >= _REACTION,
            lambda dt: self._go(dt, self._gripper() + np.array([-_READY, _OFFERED, 0.0])),
            lambda dt: self._go(dt, self._gripper() + np.array([0.0, _OFFERED, 0.0])),
            self._push,
            lambda _dt: self._since >= 2.0 * _CLOSING,
            lambda dt: self._close(dt, closed=False),
            self._back_off,
            lambda dt: self._go(dt, self._rest),
        ]

    def _practise(self, dt: float, target: Mapping[str, Any]) -> None:
        place = target.get("place")
        if place is not None:
            self.closed = False
            self._go(dt, np.array(place))
        elif target.get("name"):
            self._since += dt
            if self._since > _CLOSING:
                self.closed, self._since = not self.closed, 0.0

    def _back_off(self, dt: float) -> bool:
        """Lead the hand away from where it gave the object; return whether it is there."""
        if self._retreat is None:
            self._retreat = self.place - np.array([_READY, 0.0, 0.0])
        return self._go(dt, self._retreat)

    def _go(self, dt: float, goal: Floats) -> bool:
        """Lead the hand towards a place, m, in W; return whether it is there."""
        way = goal - self.place
        far = float(np.linalg.norm(way))
        step = _SPEED * dt
        self.place = goal.copy() if far <= step else self.place + way * (step / far)
        return far <= _NEAR and float(np.linalg.norm(self._scene.place("hand") - goal)) < 3.0 * _NEAR

    def _close(self, _dt: float, *, closed: bool) -> bool:
        self.closed = closed
        return self._since >= _CLOSING

    def _pull(self, dt: float) -> bool:
        """Pull until the jaws have opened, or for long."""
        self.place = self.place - np.array([_PULL * dt, 0.0, 0.0])
        return self._jaws_apart() > self._gap + 0.01 or self._since > 8.0

    def _push(self, dt: float) -> bool:
        """Push until the jaws have closed, or for long."""
        self.place = self.place + np.array([_PUSH * dt, 0.0, 0.0])
        return self._jaws_apart() < self._gap - 0.01 or self._since > 5.0

    def _gripper(self) -> Floats:
        return 0.5 * (self._scene.middle("gripper", 1) + self._scene.middle("gripper", 2))

    def _jaws_apart(self) -> float:
        return float(np.linalg.norm(self._scene.middle("gripper", 1) - self._scene.middle("gripper", 2)))

    def _object_end(self) -> Floats:
        """Return where to take hold of the object: towards its end that the gripper does not have."""
        along = self._scene.orientation("object")[:, 1]
        p = self._scene.place("object")
        side = 1.0 if float(along @ (p - self._gripper())) > 0.0 else -1.0
        return p + side * _HOLD * along


class ScriptedPilot:
    """Takes part in one session over a connection as a page's.

    Args:
        connection: to the seat.
        seed: of its answers.
    """

    def __init__(self, connection: ClientConnection, seed: int) -> None:
        self._connection, self._rng = connection, np.random.default_rng(seed)
        self._scene: SeenScene | None = None
        self._hand: ScriptedHand | None = None
        self._target: Mapping[str, Any] | None = None
        self._drawn: list[float] = []
        self._stamp = float("nan")
        self.screen: Mapping[str, Any] = {}

    async def take_part(self) -> None:
        """Go through a session to its end.

        Raises:
            ConnectionClosed: the server has ended.
            PilotRefused: something that it did was refused.
        """
        async for message in self._connection:
            if isinstance(message, bytes):
                await self._see(message)
                continue
            content = json.loads(message)
            if "refused" in content or "gone" in content:
                raise PilotRefused(str(content.get("refused") or content.get("gone")))
            if "scene" in content:
                self._scene, self._hand, self._drawn = SeenScene(content["scene"]), None, []
                await self._send({"ready": True})
            elif "target" in content:
                self._target = content["target"]
            elif "screen" in content:
                self.screen = content["screen"]
                if self.screen["screen"] != "practising":
                    self._target = None
                if self.screen["screen"] in ("thanks", "complete", "withdrawn"):
                    return
                answer = self._answer(self.screen)
                if answer is not None:
                    await self._send({"act": {"action": answer[0], "value": answer[1]}})
        raise PilotRefused("the server has ended the connection before the session was over")

    def _answer(self, shown: Mapping[str, Any]) -> tuple[str, Any] | None:
        match shown["screen"]:
            case "who":
                return "continue", shown["unfinished"][0]["number"]
            case "language":
                return "language", next(iter(shown["languages"]))
            case "consent":
                return "consent", True
            case "eligibility":
                return "eligibility", [True] * len(shown["eligibility"])
            case "device":
                devices = list(shown["devices"])
                return "device", {"device": SCRIPT if SCRIPT in devices else devices[0], "settings": {}}
            case "practice" | "instruction":
                return "begin", None
            case "void":
                return "next", None
            case "rating":
                low, high = int(shown["scale"]["lowest"]), int(shown["scale"]["highest"])
                return "rate", {name: low + self._pick(high - low + 1) for name in shown["statements"]}
            case "questions":
                return "answer", {q["name"]: self._choice(q["choices"]) for q in shown["questions"]}
            case _:
                return None

    def _choice(self, choices: Sequence[Mapping[str, str]]) -> str:
        return choices[self._pick(len(choices))]["value"] if choices else "scripted pilot"

    def _pick(self, n: int) -> int:
        """Return one of 0 to n - 1 by chance."""
        return int(self._rng.integers(n))

    async def _see(self, message: bytes) -> None:
        """Take in a state of the run, and send where the hand is to be."""
        scene = self._scene
        if scene is None:
            return
        scene.take(message)
        if scene.stamp == scene.stamp and scene.stamp != self._stamp:
            self._stamp = scene.stamp
            self._drawn.append(1000.0 * max(0.0, time.monotonic() - scene.stamp))
        if self._hand is None:
            self._hand = ScriptedHand(scene)
        self._hand.act(self._target)
        await self._send({"hand": hand_message(self._hand.place, self._hand.closed, time.monotonic())})
        if len(self._drawn) >= 5:
            drawn, self._drawn = self._drawn, []
            await self._send({"drawn": drawn})

    async def _send(self, message: Mapping[str, Any]) -> None:
        await self._connection.send(json.dumps(message))


class PilotRefused(RuntimeError):
    """The server has refused what a scripted pilot did."""


def hand_message(place: Floats, closed: bool, stamp: float) -> dict[str, Any]:
    """Return a sample of the hand as a page sends it."""
    pose = {"p_WH": place.tolist(), "q_WH": [1.0, 0.0, 0.0, 0.0], "closed": closed}
    return {**pose, "stamp": stamp, "device": SCRIPT}


async def play_sessions(address: str, plan: StudyPlan, tell: Callable[[str], None]) -> None:
    """Let scripted pilots take part, one after the other, until all of the plan have.

    Args:
        address: of the study's page.
        plan: the study's.
        tell: is given a line for each session.

    Raises:
        PilotRefused: something that they did was refused.
        ConnectionClosed, OSError: the server has ended, or cannot be reached.
    """
    origin = "http://" + address.split("//", 1)[1].split("/", 1)[0]
    seat = address.replace("http://", "ws://", 1) + "seat"
    async with connect(seat, origin=origin, max_size=None) as connection:  # type: ignore
        for number in range(1, plan.participants + 1):
            pilot = ScriptedPilot(connection, plan.seed + number)
            await pilot.take_part()
            if pilot.screen["screen"] == "complete":
                return
            tell(f"{pilot.screen['participant']}: a scripted pilot has taken part")
            await connection.send(json.dumps({"act": {"action": "next"}}))
            await asyncio.sleep(0)


def _unpacked(packed: Mapping[str, Any]) -> Floats:
    """Return the numbers of a packed array, decoded to float64."""
    data = np.frombuffer(base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}").astype(np.float64)
    return packed["low"] + packed["step"] * data if "step" in packed else data
