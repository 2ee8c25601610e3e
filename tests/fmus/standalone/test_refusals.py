"""What cannot be given away with an interpreter is reported when it is built, and nothing is written."""

import importlib.metadata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy
import pytest
from click.testing import CliRunner
from support.fmus.written_blocks import write_block

from handover.fmus.build import build
from handover.fmus.catalog import own_unit
from handover.fmus.compile import TARGETS, host_platform
from handover.fmus.sources import FileElsewhere
from handover.fmus.standalone import freezer
from handover.fmus.standalone.freezer import CannotFreeze
from handover.scenarios.cli.units import build as build_units
from handover.scenarios.cli.units.build import build_command


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of modules of one's own, which has a table and a folder elsewhere beside it."""
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "table.csv").write_text("2.5\n")
    monkeypatch.syspath_prepend(folder)  # type: ignore
    monkeypatch.chdir(folder)
    return folder


def reader(folder: Path, name: str, place: str) -> str:
    """Write a block that reads a file at a place, an expression; return the block's path."""
    return write_block(folder, name, f"float(__import__('pathlib').{place}.read_text())", f"{name}_helper")


BESIDE = "Path(__file__).parent.joinpath('table.csv')"


def refused(*given: str) -> str:
    result = CliRunner().invoke(build_command, [*given, "--out", "built"])
    assert result.exit_code != 0
    assert not Path("built").exists() or not list(Path("built").glob("*.fmu"))
    return result.output


@pytest.fixture
def compiles_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have no runtime for any platform, and fail where one is compiled."""

    def fail(targets: Sequence[str]) -> None:
        raise AssertionError(f"the runtime for {targets} is compiled first")

    def is_current(target: str) -> bool:
        return target not in TARGETS

    monkeypatch.setattr(build_units, "is_current", is_current)
    monkeypatch.setattr(build_units, "has_compiler", lambda: True)
    monkeypatch.setattr(build_units, "compile_runtime", fail)


@pytest.mark.usefixtures("folder", "compiles_nothing")
@pytest.mark.parametrize("platforms", ["{other}", "host,{other}", "all"])
def test_for_another_platform(platforms: str):
    other = next(target for target in TARGETS if target != host_platform())
    why = refused("Push", "--standalone", "--platform", platforms.format(other=other))
    assert f"this machine's platform only, {host_platform()}, since PyInstaller copies" in why
    assert f"build the unit for {other}" in why
    assert f"for {host_platform()}" not in why


@pytest.mark.usefixtures("folder", "compiles_nothing")
def test_without_pyinstaller(monkeypatch: pytest.MonkeyPatch):
    def version(name: str) -> str:
        if name == "pyinstaller":
            raise importlib.metadata.PackageNotFoundError
        return "1"

    monkeypatch.setattr(freezer.importlib.metadata, "version", version)
    cure = 'Cure: pip install "handover-cosim[standalone]"'
    assert cure in refused("Push", "--standalone", "--fmi", "3", "--platform", "host")


def test_a_file_beside_the_module_goes_along_and_others_are_refused(folder: Path, tmp_path: Path):
    named, block = (
        reader(folder, module, place)
        for module, place in (("names_it", "Path(__file__).with_name('table.csv')"), ("reads_beside", BESIDE))
    )
    elsewhere = tmp_path / "elsewhere.csv"
    elsewhere.write_text("1\n")
    for file in (elsewhere, folder / "nothing.csv"):
        with pytest.raises(FileElsewhere, match="the folder of the block's module"):
            build(own_unit(block, None), 3, tmp_path, include=[file])
    fmus = [
        build(own_unit(named, None), 3, tmp_path / "named"),
        build(own_unit(block, None), 3, tmp_path, include=[folder / "table.csv"]),
    ]
    (folder / "table.csv").write_text("no number\n")
    for fmu in fmus:
        result: Any = fmpy.simulate_fmu(str(fmu), stop_time=0.1, output=["y"])  # type: ignore
        assert result["y"][-1] == 2.5


@pytest.mark.usefixtures("compiles_nothing")
def test_a_file_elsewhere_is_refused_before_anything_is_compiled(folder: Path):
    block = reader(folder, "reads_nothing_else", BESIDE)
    assert "--include: nothing.csv does not lie in" in refused(block, "--include", "nothing.csv", "--platform", "host")
    assert "--include is for units of your own" in refused("Push", "--include", "table.csv")


@pytest.mark.slow
def test_a_file_that_the_frozen_unit_lacks_can_be_included(folder: Path, tmp_path: Path):
    beside = own_unit(reader(folder, "reads_missing", BESIDE), None)
    with pytest.raises(CannotFreeze, match=r"opens table\.csv, which the FMU does not have there; open it beside the"):
        build(beside, 3, tmp_path / "out", standalone=True)
    assert not list((tmp_path / "out").glob("*"))
    assert build(beside, 3, tmp_path / "out", standalone=True, include=[folder / "table.csv"]).is_file()
