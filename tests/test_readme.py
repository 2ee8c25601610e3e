"""Commands and programs of README and guides do what these say."""

import contextlib
import importlib.util
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from support.commands import Ended, run_command
from support.documentation import PAGES, ROOT, TEXT, TEXTS, blocks
from support.in_process_pool import use_in_process_pool
from support.kept_runs import copied_run, kept_run

from handover.cosim.stepping.options import Algorithm
from handover.fmus import interpreter
from handover.fmus.compile import TARGETS
from handover.scenarios.cli.command import main
from handover.scenarios.runs.results.tables import format_metric

COMMANDS = [line for text in blocks(TEXT) for line in text.splitlines() if line.startswith(".venv/")]
RUNS = [c for c in COMMANDS if " run " in c and "--live" not in c]
OF_FILES = ("model=", "units/", ".ssp")
"""In runs that read what another command has written."""
IN_PYTHON, STEPS, AGENT, OWN_SYSTEM, TERMINALS = blocks(TEXTS["python"], "python")
(IN_FMPY,) = blocks(TEXTS["other_tools"], "python")
OWN_BLOCK, OWN_BUILD = blocks(TEXTS["own"], "python")


def handover(command: str, folder: Path, *more: str) -> Ended:
    """Run a command, with more arguments, in a folder; a campaign's runs are executed by its own process."""
    return run_command(*shlex.split(command)[1:], *more, cwd=folder, before=use_in_process_pool)


def succeeded(command: str, folder: Path, *more: str) -> str:
    done = handover(command, folder, *more)
    assert done.status == 0, (command, done.output, done.errors)
    return done.output


def program(text: str, folder: Path, patch: pytest.MonkeyPatch) -> str:
    """Run a program in a folder, and return what it prints."""
    patch.chdir(folder)
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(text, "guide", "exec"), {"__name__": "__main__"})
    return printed.getvalue()


def test_the_citation_is_of_this_version():
    cited, own = (
        re.findall(r'^version\W+([\d.]+)"?$', (ROOT / file).read_text(), flags=re.MULTILINE)
        for file in ("CITATION.cff", "pyproject.toml")
    )
    assert cited == own != []


def test_the_guide_lists_the_algorithms_that_there_are_with_their_traits():
    rows = [
        (f"`{a.value}`", a.summary, "cycles" if a.iterates else "algebraic loops", "yes" if t.in_plan else "no")
        for a in Algorithm
        for t in (a.coupling.traits,)
    ]
    table = TEXTS["master"].partition("## Algorithms")[2].strip().partition("\n\n")[0]
    assert table.splitlines()[2:] == [f"| {' | '.join(row)} |" for row in rows]


def test_every_path_that_is_linked_exists():
    for page in PAGES:
        for path in re.findall(r"\]\((?!http)([^)#]+)[^)]*\)", TEXTS[page.stem]):
            linked = (page.parent / path).resolve()
            assert linked.exists() or "reference" in linked.parts, f"{page.name}: {path}"  # which the build makes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a tree that looks like the repository's, in which the units have been built."""
    made = tmp_path_factory.mktemp("repository")
    for name, target in ((".venv", Path(sys.prefix)), ("docs", ROOT / "docs"), ("fmus", ROOT / "fmus")):
        (made / name).symlink_to(target)
    succeeded(command_with(" build TendonArm "), made)
    return made


@pytest.mark.slow
def test_a_unit_runs_in_fmpy(folder: Path, monkeypatch: pytest.MonkeyPatch):
    printed = program(IN_FMPY, folder, monkeypatch)
    assert [float(n) for n in printed.strip().strip("[]").split()] == pytest.approx([0.0, 0.0, -0.7], abs=1e-6)


def test_a_unit_tells_its_terminals(folder: Path):
    reported = succeeded(command_with(" info "), folder)
    listed = [line.split()[0] for line in reported.partition("\nTerminals")[2].splitlines() if line]
    assert listed == ["wrist", "gripper", "actuators"]


@pytest.mark.skipif(sys.platform != "linux" or not interpreter.library(), reason="the program looks for linux64")
def test_a_unit_runs_in_a_c_program(folder: Path):
    script = block_with("./c_host")
    if shutil.which("cc") is None:
        assert ".venv/bin/python -m ziglang cc" in TEXT
        script = script.replace("\ncc ", "\n.venv/bin/python -m ziglang cc ")
    printed = shell(script, folder)
    assert f"prints `{printed.strip()}`" in TEXT


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ecospy") is None, reason="ecospy has wheels for few platforms")
@pytest.mark.skipif(shutil.which("unzip") is None, reason="Ecos calls unzip")
@pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that Ecos can load")
def test_a_unit_runs_in_ecos(folder: Path):
    install, *commands = block_with("./ecos ").splitlines(keepends=True)
    assert install == ".venv/bin/python -m pip install ecospy tbb\n"  # the tests' environment has them
    shell("".join(commands), folder)
    header, *rows = (folder / "TendonArm.fmi2.csv").read_text().splitlines()
    column = header.split(", ").index("instance::p_WG[3][REAL]")
    assert len(rows) >= 50
    assert {row.split(", ")[column] for row in rows} == {"-0.700000"}
    (scalar,) = re.findall(r"`\.venv/bin/(handover build [^`]*--scalar[^`]*)`", TEXT)
    succeeded(scalar, folder)
    assert (folder / "units" / "TendonArm.fmi3-scalar.fmu").is_file()


@pytest.mark.slow
def test_units_pass_their_checks_and_one_brings_an_experiment_along_that_its_check_repeats(folder: Path):
    succeeded(command_with(" check units/TendonArm"), folder)
    succeeded(command_with(" --prove "), folder)
    assert "outputs compared, all equal" in succeeded(command_with(" check units/FreeFlyer"), folder)


@pytest.mark.platforms
def test_a_unit_is_built_for_all_platforms(folder: Path):
    succeeded(command_with(" --platform all "), folder)
    with zipfile.ZipFile(folder / "units" / "Push.fmi3.fmu") as archive:
        libraries = [name for name in archive.namelist() if name.startswith("binaries/")]
    assert len(libraries) == len(TARGETS)


def test_commands_that_compile_for_all_platforms_or_film_have_options_that_there_are():
    """What they do, the first in the tier `platforms`, the other in tests/scenarios/pages/film."""
    for part in (" --platform all ", " film "):
        done = CliRunner().invoke(main, [*shlex.split(command_with(part))[1:], "--help"])
        assert done.exit_code == 0, done.output


@pytest.mark.platforms
def test_a_unit_brings_its_interpreter(folder: Path):
    succeeded(command_with(" --standalone "), folder)
    (size,) = re.findall(r"`units/Push.fmi3-standalone.fmu`[^`]*?, (\d+) MB", TEXT)
    file = folder / "units" / "Push.fmi3-standalone.fmu"
    assert file.stat().st_size < 40e6
    assert file.stat().st_size == pytest.approx(1e6 * float(size), rel=0.1)


@pytest.mark.slow
def test_data_beside_a_unit_goes_along_with_it(tmp_path: Path):
    (option,) = re.findall(r"`(--include (?:\S+))`", TEXT)
    file = option.split()[1]
    read = f"        self.k = params.k * float(Path(__file__).parent.joinpath({file!r}).read_text())\n"
    block = OWN_BLOCK.replace("        self.k = params.k\n", read)
    assert read in block
    (tmp_path / "tabled.py").write_text(f"from pathlib import Path\n\n{block}")
    (tmp_path / file).write_text("2.0")
    for out, given in (("with", option), ("without", "")):
        succeeded(f"handover build tabled:Spring --fmi 3 --platform host {given} --out {out}", tmp_path)
    (tmp_path / file).unlink()
    checks = [handover(f"handover check {out}/Spring.fmi3.fmu", tmp_path) for out in ("with", "without")]
    assert [done.status for done in checks] == [0, 1]
    assert file in checks[1].output


def command_with(part: str) -> str:
    (command,) = (c for c in COMMANDS if part in c)
    return command


def block_with(part: str) -> str:
    (block,) = (text for text in blocks(TEXT) if part in text)
    return block


def shell(script: str, folder: Path) -> str:
    call = ["sh", "-e", "-c", script]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("text", "printed", "made"),
    [
        pytest.param(IN_PYTHON, "True closed at ", ["hand.png", "runs/*/signals.parquet"], id="run"),
        pytest.param(STEPS, "3.008 [", [], id="steps", marks=pytest.mark.slow),
        pytest.param(AGENT, "Box(-inf, inf, (3,), float64)", [], id="agent"),
        pytest.param(OWN_SYSTEM, "[0.25 0.   0.  ]\n", ["push/signals.parquet"], id="system"),
        pytest.param(TERMINALS, "robot.p_WB -> navigation.p_WB (terminal base)", [], id="terminals"),
    ],
)
def test_programs_print_and_make_what_they_say(
    text: str, printed: str, made: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert printed in program(text, tmp_path, monkeypatch)
    assert [len([*tmp_path.glob(file)]) for file in made] == [1] * len(made)


def test_a_block_of_ones_own_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "spring.py").write_text(OWN_BLOCK)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "spring", raising=False)
    printed = program(OWN_BUILD, tmp_path, monkeypatch).strip()
    assert (tmp_path / printed).is_file()
    (command,) = re.findall(r"`\.venv/bin/(handover build spring:Spring [^`]*)`", TEXT)
    assert printed in succeeded(command, tmp_path)


def arguments_of(command: str) -> Sequence[str]:
    """Return what a run is called with, without a page or a folder of its own."""
    given = shlex.split(command)[1:]
    if "--out" in given:
        del given[given.index("--out") :][:2]
    return (*given, "--no-report")


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in RUNS if not any(text in c for text in (*OF_FILES, " --out "))])
def test_the_runs_succeed(command: str):
    """Those of the Helix and the handover for a moment: whole ones are in tests/scenarios/robots."""
    begins = ("--stop", "0.2") if " helix_" in command or " flyer_robot_" in command else ()
    summary = json.loads((kept_run(*arguments_of(command), *begins) / "summary.json").read_text())
    assert summary["complete"]
    assert summary["success"] is not bool(begins), summary["reason"]


@pytest.mark.slow
def test_the_first_run_prints_what_the_readme_shows_of_it():
    (shown,) = blocks(TEXTS["README"], "text")
    verdict, *rows, _ = shown.splitlines()
    summary = json.loads((kept_run("run", "helix_handover") / "summary.json").read_text())
    assert verdict == f"helix_handover succeeded: {summary['reason']}"
    printed = {m["description"]: format_metric(m) for m in summary["metrics"].values()}
    of_readme = [re.split(r"\s{2,}", row.strip()) for row in rows]
    assert of_readme == [[what, printed[what]] for what, _ in of_readme]


def test_nothing_is_installed_from_an_index_on_which_it_is_not():
    assert "not on an index yet" in TEXT
    pages = [*PAGES, *(ROOT / "docs" / "tutorials").glob("*.md")]
    named = r"pip install [^`\n]*handover-cosim"
    assert [page.name for page in pages if re.search(named, page.read_text(encoding="utf-8"))] == []


@pytest.mark.slow
def test_a_run_is_reported_again(tmp_path: Path):
    (command,) = (c for c in RUNS if c.endswith(" --out r"))
    copied_run(tmp_path / "r", *arguments_of(command), "--stop", "0.5")
    succeeded(command_with(" report "), tmp_path)
    assert (tmp_path / "r" / "report.html").is_file()


@pytest.mark.slow
def test_a_model_is_trained_run_and_adapted(tmp_path: Path):
    train, adapt = (c for c in COMMANDS if " vsl-train " in c)
    succeeded(train, tmp_path)
    run = handover(command_with(" run vsl_hybrid -p model="), tmp_path, "--no-report", "--stop", "0.1", "--out", "r")
    assert run.status == 1, run.errors  # it is ended
    succeeded(adapt, tmp_path)
    assert (tmp_path / "stiffer_arm.json").is_file()


@pytest.mark.slow
def test_files_are_run(folder: Path):
    succeeded(command_with(" export "), folder)
    assert "succeeded" in succeeded(command_with(" run grasp.ssp "), folder, "--no-report")
    of_input = command_with(" --input ")
    shell("".join(line + "\n" for line in block_with(of_input).splitlines() if line.startswith("printf ")), folder)
    assert "succeeded" in succeeded(of_input, folder, "--no-report")
    done = handover(command_with(" --unit arm=units/"), folder, "--stop", "0.5", "--no-report", "--out", "other_arm")
    assert done.status == 1, done.errors  # it ends before the grasp
    run = json.loads((folder / "other_arm" / "run.json").read_text())
    assert run["units"]["arm"]["fmu"] == "TendonArm.fmi2.fmu"


def test_what_a_place_needs_is_listed(tmp_path: Path):
    assert "dl_t" in succeeded(command_with(" list "), tmp_path)


@pytest.mark.slow
def test_campaigns_end_with_a_page(tmp_path: Path):
    grasps, loads = (c for c in COMMANDS if " sweep " in c and c not in block_with(" compare "))
    succeeded(grasps, tmp_path, "--repeat", "1", "--stop", "0.1")
    assert (tmp_path / "c" / "report.html").is_file()
    succeeded(loads, tmp_path, "--stop", "0.04", "--no-report")
    (campaign,) = (tmp_path / "campaigns").iterdir()
    assert len([*(campaign / "runs").iterdir()]) == 10


def test_a_published_experiment_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its runs, of which there are many, in tests/scenarios/cli/test_paper.py."""
    begun: list[Sequence[Any]] = []

    def run(*given: Any) -> None:
        begun.append(given)
        sys.exit(0)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("handover.scenarios.cli.campaign._run", run)
    assert CliRunner().invoke(main, shlex.split(command_with(" paper "))[1:]).exit_code == 0
    assert len(begun) == 1


@pytest.mark.slow
def test_campaigns_are_compared(tmp_path: Path):
    ours, theirs, compare = block_with(" compare ").splitlines()
    for command in (ours, theirs):
        succeeded(command, tmp_path, "--repeat", "2", "--no-report", "--stop", "0.1")
    succeeded(compare, tmp_path)
    comparison = tmp_path / compare.split()[-1]
    assert {"report.html", "comparison.csv", "comparison.json", "figures"} == {p.name for p in comparison.iterdir()}
    found = json.loads((comparison / "comparison.json").read_bytes())
    assert all(test["paired"] for test in found["tests"])  # "run by run where they share seeds, as these do"
    assert {p.suffix for p in (comparison / "figures").iterdir()} == {".png", ".svg", ".pdf"}


def test_the_plan_of_a_study_is_written_and_checked(tmp_path: Path):
    new, check = (c for c in COMMANDS if " study " in c)
    succeeded(new, tmp_path)
    assert "12" in succeeded(check, tmp_path)
