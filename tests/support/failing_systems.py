"""Systems with native units that fail, as SSPs, and `handover run` in a process of its own, which runs them."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from support.commands import Command
from support.cosim.native_units import native_fmu
from support.processes import until


def failing_ssp(folder: Path, bad: str, fmi: int = 3) -> Path:
    """Write a system of a sine, the native unit `bad` that gets it, and an integrator, of 0.1 s steps until 1 s."""
    return failing_chain(folder, [bad], fmi, name=bad)


def failing_chain(folder: Path, bad: Sequence[str], fmi: int = 3, name: str = "chain") -> Path:
    """Write such a system of several units `bad`, each of which gets the output of the one before."""
    s = System()
    output = s.add("source", native_fmu("sine", fmi)).y.y
    for number, each in enumerate(bad):
        unit = s.add("bad" if len(bad) == 1 else f"bad{number}", native_fmu(each, fmi))
        s.connect(output, unit.u.u)
        output = unit.y.y
    s.connect(output, s.add("reader", native_fmu("integrator", fmi)).u.u)
    return write_ssp(s, folder / f"{name}.ssp", name, Fraction(1))


def start(folder: Path, *arguments: object, privileged: bool = True) -> Command:
    """Start `handover run` in a folder, whose `tmp` is its place for temporary files."""
    (folder / "tmp").mkdir(exist_ok=True)
    return Command("run", *arguments, cwd=folder, env={"TMPDIR": str(folder / "tmp")}, privileged=privileged)


def wait_until(there: Callable[[], bool], going: Command) -> None:
    """Wait until something is there, as long as a command goes on."""
    until(lambda: there() or going.poll() is not None)
    assert there(), going.wait()
