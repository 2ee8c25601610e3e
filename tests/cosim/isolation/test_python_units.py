"""Isolated units whose library uses Python and names no library of it, as those of pythonfmu: their host brings it."""

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import pytest

from handover.cosim.exceptions import InvalidFmu
from handover.cosim.isolation import unit_process
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus import interpreter

_SOURCE = """
import numpy
from {package} import Fmi{fmi}Causality, Fmi{fmi}Slave, {real}

class Doubling(Fmi{fmi}Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable({real}("y", causality=Fmi{fmi}Causality.output))

    def do_step(self, current_time, step_size):
        self.y = float(numpy.float64(2.0) * (current_time + step_size))
        return True
"""


@pytest.fixture(scope="module", params=[2, 3])
def doubling(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of a class in Python, by pythonfmu or pythonfmu3."""
    fmi: int = request.param
    package, real = ("pythonfmu", "Real") if fmi == 2 else ("pythonfmu3", "Float64")
    pytest.importorskip(package)
    folder = tmp_path_factory.mktemp(package)
    source = folder / "doubling.py"
    source.write_text(_SOURCE.format(package=package, fmi=fmi, real=real))
    command = [sys.executable, "-m", package, "build", "-f", str(source), "-d", str(folder)]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
    return folder / "Doubling.fmu"


def isolated(fmu: Path) -> Master:
    system = System()
    system.add("unit", fmu, period=Fraction(1, 10))
    return Master(system, MasterOptions(isolated=("unit",)))


@pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library")
@pytest.mark.parametrize("path", ["as it is", "of another Python"])
def test_it_runs_with_this_python(doubling: Path, path: str, monkeypatch: pytest.MonkeyPatch):
    if path == "of another Python":  # as where the virtual environment is not activated
        monkeypatch.setenv("PATH", "/usr/bin:/bin")
    rows: list[tuple[float, float]] = []

    def observe(t: float, signals: Signals) -> None:
        rows.append((t, float(signals["unit.y"])))

    with isolated(doubling) as master:
        master.run(Fraction(1, 2), [observe])
    assert rows == [(t, pytest.approx(2.0 * t)) for t in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)]


def test_where_this_python_has_no_library_cause_and_cure_are_told(doubling: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(unit_process, "_libpython", lambda: "")
    with pytest.raises(InvalidFmu, match=r"it uses Python \(_?Py\w+\), but names no library of Python") as told:
        isolated(doubling).__enter__()
    assert "Cure: run it without isolation, or install Debian's libpython3" in str(told.value)
