"""A run that a live page shows: its folder, its controls, what is seen of it, and what a page does in it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from handover.cosim.master.live_control import LiveControl
from handover.scenarios.experiment.live_inputs import Pushable
from handover.scenarios.live.commands import Push
from handover.scenarios.live.hand_seat import HandSeat
from handover.scenarios.live.process import PageInputs
from handover.scenarios.live.stage import Stage
from handover.scenarios.live.watched_run import WatchedRun


@dataclass
class ShownRun:
    """A run that a page shows.

    Attributes:
        run: its folder.
        control: of its pace; it is paused until a page shows it.
        controls: folder of the controls, and of the inputs that a page sets, once the run has made them.
        stage: its scene and plots, None until its first row.
        inputs: these inputs, likewise.
        seat: of the device that leads a hand, likewise; None where none is led.
    """

    run: WatchedRun
    control: LiveControl
    controls: Path
    stage: Stage | None = None
    inputs: PageInputs = field(default_factory=PageInputs)
    seat: HandSeat | None = None

    def begin(self, stage: Stage) -> None:
        """Take in the run's stage, and let pages set its inputs."""
        self.stage, self.inputs = stage, PageInputs.open(self.controls)
        led = None if self.inputs.hand is None else self.run.led_hand()
        if self.inputs.hand is not None and led is not None:
            self.seat = HandSeat(led, self.inputs.hand, lambda: stage.wanted_hand(led))

    def end(self) -> None:
        """Leave in the run's folder what led its hand."""
        if self.seat is not None:
            self.seat.write_report(self.run.folder.path)

    @property
    def pushes(self) -> Sequence[Pushable]:
        """What can be pushed in it."""
        board = self.inputs.pushes
        if board is None or self.stage is None:
            return ()
        return [push for push in self.stage.pushes if f"{push.unit}.{push.force}" in board.sizes]

    def push(self, asked: Push) -> None:
        """Push a body."""
        assert self.inputs.pushes is not None
        given = zip(asked.body.inputs, (asked.force, asked.point), strict=False)  # some bodies have no input of a point
        values = {f"{end.unit}.{end.port}": value for end, value in given}
        self.inputs.pushes.set(values, time.monotonic())
