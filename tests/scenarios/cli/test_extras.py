"""What the base installation does, and what it says of the extras that it lacks."""

import os
import subprocess
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

import pytest
from click.testing import CliRunner
from packaging.requirements import Requirement

from handover.scenarios.cli.command import main
from handover.scenarios.execution.errors import UsageError

ROOT = Path(__file__).parents[3]
MAIN = "from handover.scenarios.cli.entry import main; main()"


def distributions(name: str, extras: Iterable[str] = ()) -> "set[str]":
    """Return the names of a distribution and of all that it requires, without extras that are not asked for."""
    found: set[tuple[str, str]] = set()
    waiting = [(name, extra) for extra in ("", *extras)]
    while waiting:
        of, extra = waiting.pop()
        if (of, extra) in found:
            continue
        found.add((of, extra))
        for requirement in map(Requirement, metadata.requires(of) or []):
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                waiting += [(requirement.name, wanted) for wanted in ("", *requirement.extras)]
    return {of for of, _ in found}


def size(names: Iterable[str]) -> int:
    """Return how many bytes distributions have installed."""
    files = [file for name in names for file in metadata.files(name) or []]
    return sum(Path(str(file.locate())).stat().st_size for file in files if Path(str(file.locate())).is_file())


def test_a_folder_that_is_none_is_told_before_an_extra_that_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def lacking(*_: str) -> None:
        raise UsageError("matplotlib missing")

    monkeypatch.setattr("handover.scenarios.cli.resume.require_extra", lacking)
    empty = tmp_path / "empty"
    empty.mkdir()
    for folder, told in ((tmp_path / "nosuch", "is no folder"), (empty, "it has no run.json")):
        result = CliRunner().invoke(main, ["resume", str(folder)])
        assert (result.exit_code, told in result.output) == (2, True), result.output


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder like site-packages that has what the package requires without extras, and nothing else."""
    folder = tmp_path_factory.mktemp("base") / "site-packages"
    folder.mkdir()
    for name in distributions("handover-cosim"):
        for top in {Path(file.parts[0]) for file in metadata.files(name) or [] if file.parts[0] != ".."}:
            place = Path(str(metadata.distribution(name).locate_file(top)))
            if place.exists() and not (folder / top).exists() and "__editable__" not in top.name:
                (folder / top).symlink_to(place)
    return folder


def handover(base: Path, folder: Path, *arguments: object, program: str = MAIN) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [
            sys.executable,
            "-S",
            "-c",
            f"import sys; sys.path += {[str(ROOT), str(base)]}\n{program}",
            *map(str, arguments),
        ],
        cwd=folder,
        env={**os.environ, "HANDOVER_CACHE": str(base.parent / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def test_the_base_installation_takes_less_than_half(base: Path):
    assert not (base / "scipy").exists()
    assert size(distributions("handover-cosim")) < 0.5 * size(distributions("handover-cosim", ["all"]))


@pytest.mark.slow
def test_the_base_installation_builds_checks_and_runs_units(base: Path, tmp_path: Path):
    for arguments in (
        ["list"],
        ["list", "helix_handover"],
        ["list", "FreeFlyer"],
        ["build", "FreeFlyer", "--out", "."],
        ["check", "FreeFlyer.fmi3.fmu"],
        ["run", "FreeFlyer.fmi2.fmu", "--stop", "0.2", "--no-report", "--out", "one"],
        ["run", "vsl_model_based", "--no-report", "--out", "two"],
        ["export", "vsl_hybrid", "--ssp", "vsl.ssp"],
    ):
        done = handover(base, tmp_path, *arguments)
        assert done.returncode == 0, done.stdout
    assert (tmp_path / "two" / "signals.parquet").is_file()


IN_PYTHON = """
import handover
system = handover.System()
system.add("one", handover.unit("Push"))
run = handover.run(system, stop=0.1, out="one")
assert run.success and handover.load("one").signals["one.f_G"].any() == 0
assert "results: one" in run._repr_html_()
with handover.open("vsl_model_based") as session:
    session.step(0.1)
for call in (
    lambda: run.plot("one.f_G"),
    lambda: run.replay(),
    lambda: run.report(),
    lambda: handover.run(system, stop=0.1, out="two", report=True),
    lambda: handover.sweep("vsl_model_based", load=[0.0, 0.025], out="three"),
    lambda: handover.Campaign("four"),
    lambda: handover.environment("vsl_model_based", "kinematics"),
):
    try:
        call()
    except (handover.InvalidInput, ImportError) as e:
        print(type(e).__name__, e)
"""


@pytest.mark.slow
def test_python_runs_and_steps_on_the_base_installation_and_names_the_extra_of_all_else(base: Path, tmp_path: Path):
    done = handover(base, tmp_path, program=IN_PYTHON)
    lines = done.stdout.splitlines()
    told = [
        ("reports", "matplotlib"),
        *3 * [("reports", "plotly")],
        *2 * [("campaigns", "scipy")],
        ("gym", "gymnasium"),
    ]
    assert len(lines) == len(told), done.stdout
    for line, (extra, names) in zip(lines, told, strict=True):
        assert line.startswith("ImportError" if extra == "gym" else "InvalidInput")
        assert f"handover-cosim[{extra}]" in line
        assert names in line
    assert {p.name for p in tmp_path.iterdir()} == {"one"}


@pytest.mark.parametrize(
    ("arguments", "extra", "names"),
    [
        (["run", "helix_handover", "--out", "r"], "reports", "plotly"),
        (["run", "helix_handover", "--no-report", "--out", "r"], "robots", "cv2"),
        (["run", "ir_grasp", "--no-report", "--out", "r"], "robots", "pymunk"),
        (["run", "flyer_impedance", "--no-report", "--out", "r"], "robots", "control"),
        (["sweep", "ir_grasp", "strategy=reflex,blind", "--out", "r"], "campaigns", "distributed"),
        (["paper", "ir-table", "--out", "r"], "campaigns", "distributed"),
        (["run", "flyer_impedance", "--no-report", "--live", "--out", "r"], "reports", "plotly"),
        (["report", "."], "reports", "matplotlib"),
        (["compare", ".", "."], "reports", "plotly"),
        (["film", "."], "film", "playwright"),
    ],
)
def test_what_needs_an_extra_names_it_in_one_line_and_writes_nothing(
    base: Path, tmp_path: Path, arguments: "list[str]", extra: str, names: str
):
    done = handover(base, tmp_path, *arguments)
    assert done.returncode in (2, 3)
    assert f'"handover-cosim[{extra}]"' in done.stdout
    assert names in done.stdout
    assert len(done.stdout.splitlines()) == 1
    assert not (tmp_path / "r").exists()
