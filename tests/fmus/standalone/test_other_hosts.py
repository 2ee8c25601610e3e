"""Standalone units in Ecos' own program and in libcosim, in a folder with these, the C library, and no Python.

libcosim's wheel has its library alone: a program in C calls it. Ecos' program starts `unzip` in a shell; both are
copied from this machine.
"""

import importlib.util
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from support.c_programs import compiled
from support.exchange.ecos_command import Ecos
from support.exchange.libcosim_job import needs_libcosim
from support.fmus.bare_folder import BareFolder, can_be_entered

from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus import interpreter
from handover.fmus.build import build, cached
from handover.fmus.catalog import UNITS

pytestmark = [
    pytest.mark.platforms,
    pytest.mark.skipif(not can_be_entered(), reason="only the superuser may enter a folder as the root"),
]

UNIT = UNITS["Push"]
STEPS = 150
"""The unit pushes from the hundredth on; with a handful of steps Ecos divides by 0."""

needs_ecos = pytest.mark.skipif(
    not (importlib.util.find_spec("ecospy") and shutil.which("unzip") and interpreter.library()),
    reason="ecospy has wheels for few platforms, and calls unzip; in it the plain unit loads this Python's library",
)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> BareFolder:
    return BareFolder(tmp_path_factory.mktemp("root"))


def wheels_file(package: str, path: str) -> Path:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent / path


def run(command: Sequence[str | Path]) -> str:
    environment = {"LD_LIBRARY_PATH": "/lib", "PATH": "/bin", "TMPDIR": "/tmp"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_ecos
@pytest.mark.parametrize(("fmi", "scalar"), [(2, False), (3, True)])
def test_ecos(fmi: int, scalar: bool, root: BareFolder, tmp_path: Path):
    root.add(wheels_file("ecospy", "binaries/ecos"), "/ecos")
    for program in ("sh", "unzip"):
        root.add(Path(shutil.which(program) or "").resolve(), f"/bin/{program}")
    fmu = build(UNIT, fmi, root.path, scalar=scalar, standalone=True)
    step, stop = float(UNIT.step), float(STEPS * UNIT.step)
    sizes = ["--stepSize", repr(step), "--stopTime", repr(stop)]
    run([*root.entered("/ecos"), "simulate", "--path", f"/{fmu.name}", *sizes])
    inside = fmu.with_suffix(".csv").read_text().splitlines()
    plain = cached(UNIT.name, fmi, scalar=scalar)
    Ecos(tmp_path).simulate(tmp_path, plain, step, stop)
    assert len(inside) >= STEPS
    assert len({line.partition(", ")[2].partition(", ")[2] for line in inside[1:]}) > 1  # besides iteration and time
    assert inside == (tmp_path / f"{plain.stem}.csv").read_text().splitlines()


@needs_libcosim
def test_libcosim(root: BareFolder):
    library = wheels_file("libcosimpy", "libcosimc/libcosimc.so")
    root.add(library, "/lib/libcosimc.so")
    host = root.path / "cosim_host"
    shutil.copy(compiled(Path(__file__).with_name("cosim_host.c")), host)
    fmu = build(UNIT, 2, root.path, standalone=True)
    outputs = describe_fmu(fmu).outputs.values()
    references = [str(reference) for output in outputs for reference in output.references]
    given = [str(int(UNIT.step * 10**9)), str(STEPS), *references]
    inside = run([*root.entered("/cosim_host"), "/lib/libcosimc.so", f"/{fmu.name}", *given])
    assert len(set(inside.splitlines())) > 1
    assert inside == run([host, library, cached(UNIT.name, 2), *given])
