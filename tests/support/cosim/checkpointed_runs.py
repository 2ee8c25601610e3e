"""Runs of native units that are resumed from a checkpoint."""

from fractions import Fraction
from pathlib import Path

from handover.cosim.master.checkpoint import Checkpointer, read_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import ObserveAfter, Observer
from handover.cosim.system.system import System
from support.cosim.native_units import native_fmu

STOP, EVERY = Fraction(20), Fraction(7, 2)


def record_of(folder: Path) -> Path:
    """Return where a run's record is."""
    return folder / "signals.parquet"


def checkpoint_of(folder: Path) -> Path:
    """Return where a run's checkpoint is."""
    return folder / "checkpoint.zip"


def oscillator() -> System:
    """Return two masses with a spring between, of both standards, at three rates."""
    s = System()
    a = s.add("a", native_fmu("mass", 2), x0=1.0, k=3.0, period=Fraction(1, 50))
    b = s.add("b", native_fmu("mass", 3), v0=1.0, k=2.0, period=Fraction(1, 20))
    between = s.add("between", native_fmu("spring", 3), k=5.0, d=0.01, period=Fraction(1, 30))
    s.connect(a.y.x, between.u.x1)
    s.connect(a.y.v, between.u.v1)
    s.connect(b.y.x, between.u.x2)
    s.connect(b.y.v, between.u.v2)
    s.connect(between.y.f1, a.u.f)
    s.connect(between.y.f2, b.u.f)
    return s


def run(folder: Path, *others: Observer) -> None:
    """Run from the start, with checkpoints."""
    with Master(oscillator()) as master, Recorder(record_of(folder), ["csv"]) as recorder:
        write = Checkpointer(checkpoint_of(folder), EVERY, master, recorder)
        master.run(STOP, [recorder, *others, write])


def resume(folder: Path) -> float:
    """Resume from the checkpoint and write further ones; return its time."""
    c = read_checkpoint(checkpoint_of(folder))
    with Master(oscillator()) as master:
        c.restore(master)
        with Recorder(record_of(folder), ["csv"], after=c.rows) as recorder:
            write = Checkpointer(checkpoint_of(folder), EVERY, master, recorder)
            master.run(STOP, [ObserveAfter(c.time, observe) for observe in (recorder, write)])
    return c.time
