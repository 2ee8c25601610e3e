"""A trial: one run in a process of its own, whose hand is led from outside and whose state is seen as it goes on.

Its latency is the time from a hand's movement to the picture that shows it, as the page measures it, over a round.
"""

import asyncio
import contextlib
import json
import math
import subprocess
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.files import scratch_folder
from handover.cosim.master.live_control import LiveControl
from handover.cosim.python_process import module_command
from handover.cosim.record.reader import Record
from handover.scenarios.catalog import scenario_of
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.experiment.replay import Line
from handover.scenarios.live.hand_messages import HandStream, hand_sample, hand_start
from handover.scenarios.live.live_scene import LiveScene
from handover.scenarios.live.shared_inputs import SharedInputs
from handover.scenarios.live.watched_run import WatchedRun
from handover.scenarios.runs.execution.selection import find_scenario
from handover.scenarios.runs.results.run_facts import whole_record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults
from handover.scenarios.study.folder.session_folder import RoundRecord
from handover.scenarios.study.folder.session_notes import timestamp
from handover.scenarios.study.plan.led_hands import led_hand_of

_LONGEST_LATENCY = 60_000.0
"""Time that counts as a measurement at most, ms; a page that was hidden for longer draws nothing."""
_MOST_LATENCIES = 100_000
"""Measurements that are kept: of half an hour at 60 pictures a second."""


class LatencyLog:
    """Times from input to drawn picture in a round, ms: one for each picture that shows a newer sample of the hand."""

    def __init__(self) -> None:
        self._times: list[float] = []

    def add(self, values: Any) -> None:
        """Add times that a page has measured.

        Raises:
            ValueError: they are no list of finite times from 0 on, in ms; none of them is added.
        """
        given: list[Any] = cast(list[Any], values) if isinstance(values, list) else [None]
        if not all(_is_time(v) for v in given):
            raise ValueError(f"drawn takes a list of times from 0 to {_LONGEST_LATENCY:g} ms")
        self._times += [float(v) for v in given][: _MOST_LATENCIES - len(self._times)]

    @property
    def median(self) -> float | None:
        """Median, ms; None if nothing was measured."""
        return self._quantile(0.5)

    @property
    def p95(self) -> float | None:
        """Time that 5 of 100 pictures exceed, ms."""
        return self._quantile(0.95)

    @property
    def longest(self) -> float | None:
        """The longest of them, ms."""
        return self._quantile(1.0)

    def _quantile(self, share: float) -> float | None:
        return round(float(np.quantile(self._times, share)), 3) if self._times else None


def _is_time(value: Any) -> bool:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and 0.0 <= value <= _LONGEST_LATENCY


def _median_ms(ages: Sequence[float]) -> float | None:
    """Return the median of ages in s, in ms; None of none."""
    return round(1000.0 * float(np.median(ages)), 3) if len(ages) else None


_POLL = 0.02
"""How often a run's folder is looked at until it stands at its start, s."""
_PATIENCE = 60.0
"""How long a run may take until its first row, s."""
_GRACE = 5.0
"""How long a run may take to end once it is asked to, s."""
_MOST_STAMPS = 4096
TARGET, PLUMB = "place to go", "depth"
"""Labels of what the page moves: the place of the device's test, and lines from hand and object down to the floor."""
_GHOST, _HAND, _OBJECT = "#009e73", "#8a5a2b", "#d1602b"
"""Of the palette of Okabe and Ito where it is free: told apart by colour-blind eyes."""
_RADIUS, _WIDTH = 0.025, 2.0


class TrialFailed(RuntimeError):
    """A run that did not come to its end, for a reason that is not the participant's."""


@dataclass(frozen=True)
class TrialRequest:
    """What is to be run.

    Attributes:
        scenario: its name or path.
        parameters: texts `NAME=VALUE`.
        seed: of all random numbers.
        out: the run's folder.
        led_by: what the run's folder is to say of who leads the hand.
        pace: simulated seconds per second of wall time.
    """

    scenario: str
    parameters: Sequence[str]
    seed: int
    out: Path
    led_by: Mapping[str, Any]
    pace: float = 1.0


class Frame:
    """What a page needs for a picture.

    Attributes:
        time: simulated time, s.
        stamp: page's stamp, s, of the newest sample of the hand whose effect is in it; NaN before the first.
        places: where all that is drawn is, see `LiveScene.places`.
    """

    def __init__(self, time: float, stamp: float, places: Floats) -> None:
        self.time, self.stamp, self.places = time, stamp, places

    def packed(self) -> bytes:
        """Return it as 64-bit floats: time, stamp, places."""
        return np.concatenate([[self.time, self.stamp], self.places]).astype("<f8").tobytes()


class Trial:
    """A run that waits at its start until `go`; it is killed at `close` at the latest.

    Args:
        request: what is to be run.

    Raises:
        NoHand, InvalidParameter: nobody outside can lead its hand, or a parameter is invalid.
        OSError: its process cannot be started, or its files not be made, as on a full disk.

    Attributes:
        latency: times that the page has measured.
        scene: what is seen of the run; None until `begin` has returned.
        first_place: of the object, in W, m; None before the run stands at its start.
    """

    def __init__(self, request: TrialRequest) -> None:
        self.request = request
        self.latency = LatencyLog()
        self.scene: LiveScene | None = None
        self.first_place: Floats | None = None
        self.led = led_hand_of(request.scenario, request.parameters)
        with contextlib.ExitStack() as resources:  # what fails here leaves nothing behind
            place = resources.enter_context(scratch_folder("study"))
            self._control = LiveControl.create(place / "control", request.pace, paused=True)
            resources.callback(self._control.close)
            self._inputs = SharedInputs.create(place / "inputs", self.led.inputs, [self.led.age])
            resources.callback(self._inputs.close)
            self._errors = resources.enter_context(open(place / "stderr", "w+b"))
            self._stream = HandStream(self.led)
            self._stamps: deque[tuple[int, float]] = deque(maxlen=_MOST_STAMPS)
            self._process = self._start_process(place)
            self._run = WatchedRun(request.out)
            self._resources = resources.pop_all()

    @classmethod
    async def open(cls, request: TrialRequest) -> "Trial":
        """Open a trial in a thread; where nobody waits for it any more, it is closed again."""
        opening = asyncio.ensure_future(asyncio.to_thread(cls, request))
        try:
            return await asyncio.shield(opening)
        except asyncio.CancelledError:
            with contextlib.suppress(Exception):
                await asyncio.to_thread((await opening).close)
            raise

    def _start_process(self, place: Path) -> "subprocess.Popen[bytes]":
        """Start the process of the run."""
        request = self.request
        spec = {
            "scenario": request.scenario,
            "parameters": list(request.parameters),
            "seed": request.seed,
            "out": str(request.out),
            "control": str(place / "control"),
            "inputs": str(place / "inputs"),
            "led_by": {"from": "page", **request.led_by},
        }
        command = module_command("handover.scenarios.study.session", json.dumps(spec))
        return subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self._errors, start_new_session=True
        )

    def begin(self) -> None:
        """Wait until the run stands at its start.

        Raises:
            TrialFailed: it did not get there.
        """
        late = time.monotonic() + _PATIENCE
        while self.scene is None:
            if not self.is_running or time.monotonic() > late:
                raise TrialFailed(self._why())
            self.scene = self._run.scene()
            time.sleep(_POLL)
        if f"{self.led.unit}.p_WO" in self.scene.newest:
            self.first_place = self.scene.newest[f"{self.led.unit}.p_WO"][0].copy()

    @property
    def is_running(self) -> bool:
        """Whether its process is there."""
        return self._process.poll() is None

    @property
    def newest(self) -> Record | None:
        """The newest row of the run."""
        return None if self.scene is None else self.scene.newest

    def scene_content(self) -> dict[str, Any]:
        """Return the scene as the person sees it and `createScene` takes it.

        Its last traces are moved by the page, and hidden at first: a ball at `TARGET`, then two `PLUMB` lines, of the
        hand and of the object, which help to see how far away these are.

        Raises:
            TrialFailed: the scenario has no scene, or fails as it is drawn; the message says where.
        """
        assert self.scene is not None
        hidden = np.full((1, 2, 3), np.nan)
        ball = Line(label=TARGET, colour=_GHOST, points=hidden, radii=np.full(2, _RADIUS), opacity=0.5)
        plumbs = [Line(label=PLUMB, colour=colour, points=hidden, width=_WIDTH) for colour in (_HAND, _OBJECT)]
        content = self.scene.content_for_person([ball, *plumbs])
        if content is None:
            raise TrialFailed(f"nothing can be seen of {self.request.scenario}: {self._no_scene()}")
        return content

    def _no_scene(self) -> str:
        """Return why nothing of the run can be drawn."""
        assert self.scene is not None
        kind = find_scenario(self.request.scenario)
        faults = ToleratedFaults()
        with faults.tolerated("the scene"):
            kind().replay(parse_parameters(kind, self.request.parameters), self.scene.newest)
        return "; ".join(faults.lines) or "the scenario has no scene"

    def go(self) -> None:
        """Let the run go on."""
        self._control.paused = False

    def stop(self) -> None:
        """Let the run end after its step."""
        self._control.stop, self._control.paused = True, False

    def lead(self, content: Any, arrival: float) -> None:
        """Lead the hand by a sample that arrived at the monotonic time `arrival`, s.

        Raises:
            InvalidHandMessage: it is none, is wanted beyond reach, or is older than the one before.
        """
        sample, at = self._stream.check(hand_sample(content), arrival)
        number = self._inputs.set(sample.entries(self.led), at)
        self._stamps.append((number, sample.stamp))

    def lead_by_tracker(self, text: str, page_offset: float) -> None:
        """Lead the hand by a tracker's message; `page_offset`, s, is the monotonic clock minus the page's, or NaN.

        Raises:
            InvalidHandMessage: it is none, is wanted beyond reach, older than the one before, or one too many.
        """
        sample, at = self._stream.take(text)
        number = self._inputs.set(sample.entries(self.led), at)
        self._stamps.append((number, at - page_offset))

    @property
    def hand(self) -> dict[str, Any]:
        """Where the hand is wanted as it stands, and how far it goes, as `handInput` takes it."""
        assert self.scene is not None
        return hand_start(self.led, self.scene.wanted_hand(self.led))

    def frame(self, *, always: bool = False) -> Frame | None:
        """Return what is there to be seen, None if nothing is new; `always`: also then."""
        scene = self.scene
        if scene is None or not (scene.refresh() or always):
            return None
        return Frame(scene.time, self._stamp_seen(scene.time), scene.places())

    def _stamp_seen(self, t: float) -> float:
        """Return the page's stamp of the sample that was used at the last communication point before t, s."""
        uses = self._inputs.uses()
        k = int(np.searchsorted(uses["t"], t - 1e-9)) - 1
        if k < 0:
            return math.nan
        number = int(uses["number"][k])
        while self._stamps and self._stamps[0][0] < number:
            self._stamps.popleft()
        return self._stamps[0][1] if self._stamps and self._stamps[0][0] == number else math.nan

    def record(self) -> RoundRecord:
        """Return what is known of a run that has come to its end.

        Raises:
            TrialFailed: it has not, or its folder is damaged.
        """
        self._process.wait(_GRACE)
        run = RunFolder.of_run(self.request.out)
        try:
            summary = run.read_summary()
            rule = failed_by_rule(run)
        except InvalidRunFolder as e:
            raise TrialFailed(self._why()) from e
        if not summary:  # its process was killed before it wrote one
            raise TrialFailed(self._why())
        if summary.get("failure") or not summary.get("complete", True):
            raise TrialFailed(f"the run did not come to its end: {summary.get('reason', '')}")
        pace: Mapping[str, Any] = summary.get("pace") or {}
        return RoundRecord(
            ended=timestamp(),
            success=bool(summary.get("success")),
            reason=str(summary.get("reason", "")),
            failed_by_rule=rule,
            latency_median_ms=self.latency.median,
            latency_p95_ms=self.latency.p95,
            latency_max_ms=self.latency.longest,
            age_at_use_ms=_median_ms(self._inputs.ages().tolist()),
            missed_deadlines=pace.get("missed"),
        )

    def _why(self) -> str:
        """Return why the run did not come to its end, as its process said it."""
        status = self._process.poll()
        if status is None:
            return f"the simulation did not begin within {_PATIENCE:.0f} s"
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        how = f"killed by signal {-status}" if status < 0 else f"status {status}"
        return f"the simulation's process ended ({how})" + (f": {lines[-1][:300]}" if lines else "")

    def close(self) -> None:
        """End the run's process, if it is there, and release what is shared with it."""
        if self.is_running:
            self.stop()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_GRACE)
        self._process.kill()
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._resources.close()


def failed_by_rule(run: RunFolder) -> bool | None:
    """Return whether a round failed by the thesis's rule alone; None where its record does not say who held the object.

    "It was considered a successful object handover when the object was transferred between the giver and the receiver
    being always in contact with at least one of the agents", [Fernandes2020] sec. 5.6; once it was held at all. A robot
    that does not notice, or gives up afterwards, has not failed by this rule.

    Raises:
        InvalidRunFolder: it is not the folder of a run, or damaged.
    """
    about = run.read_run()
    record = whole_record_of(run)
    receivers: Sequence[str] = getattr(scenario_of(about["scenario"], about.get("source", {})), "receivers", ())
    if record is None or not receivers or "person.holder" not in record:
        return None
    names = record.items("person.holder")
    holders = [names.get(int(code), "") for code in record["person.holder"]]
    held = holders[next((k for k, holder in enumerate(holders) if holder != "FREE"), len(holders)) :]
    rest = iter(held)
    received = all(any(holder == receiver for holder in rest) for receiver in receivers)  # one after the other
    return not received or "FREE" in held or held[-1] != receivers[-1]
