"""The README's commands and programs do what it says."""

import importlib.util
import json
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path

import pytest

from handover.cosim.stepping.options import Algorithm
from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.compile import TARGETS
from handover.fmus.contents.fmi2_description import NoFmi2Form
from handover.scenarios.catalog import SYSTEMS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)
COMMANDS = [line for kind, text in BLOCKS if not kind for line in text.splitlines() if line.startswith(".venv/")]
RUNS = [c for c in COMMANDS if " run " in c and "--live" not in c]
LIVE_RUNS = [c for c in COMMANDS if "--live" in c]
"""Begins once its page is open: tests/scenarios/live runs it."""
PROGRAMS = [text for kind, text in BLOCKS if kind == "python"]
IN_PYTHON, STEPS, AGENT, OWN_SYSTEM, TERMINALS, IN_FMPY, OWN_BLOCK, OWN_BUILD = PROGRAMS


def handover(command: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    arguments = shlex.split(command)[1:]
    call = [sys.executable, "-c", "from handover.scenarios.cli.command import main; main()", *arguments]
    return subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)


def program(text: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_readme_has_what_is_tested_here():
    assert len(RUNS) == 13
    assert len(LIVE_RUNS) == 1
    assert len([c for c in COMMANDS if " export " in c]) == 1
    assert len([c for c in COMMANDS if " build " in c]) == 4
    assert len([c for c in COMMANDS if " check " in c]) == 2
    assert len([c for c in COMMANDS if " info " in c]) == 1
    assert len([c for c in COMMANDS if " vsl-train " in c]) == 2
    assert len([c for c in COMMANDS if " sweep " in c]) == 4
    assert len([c for c in COMMANDS if " compare " in c]) == 1
    assert len([c for c in COMMANDS if " paper " in c]) == 1
    assert len([c for c in COMMANDS if " report " in c]) == 1
    assert len([c for c in COMMANDS if " film " in c]) == 1
    assert len([c for c in COMMANDS if " play " in c]) == 1
    assert len([c for c in COMMANDS if " study " in c]) == 2


def test_the_citation_is_of_this_version():
    cited, own = (
        re.search(r'^version\W+([\d.]+)"?$', (ROOT / file).read_text(), flags=re.MULTILINE)
        for file in ("CITATION.cff", "pyproject.toml")
    )
    assert cited is not None
    assert own is not None
    assert cited[1] == own[1]


def test_the_make_targets_exist():
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    named = set(re.findall(r"^make ([\w-]+)$", README, flags=re.MULTILINE))
    assert named == {"demo", "test"}
    assert named <= targets


def test_every_path_that_is_linked_exists():
    for path in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / path).exists(), path


def test_the_table_of_robots_names_their_units_and_scenarios():
    rows = [row for row in README.splitlines() if row.startswith("|") and "paper.toml" in row]
    assert len(rows) == len(SYSTEMS)
    for row, system in zip(rows, SYSTEMS, strict=True):
        _, robot, plants, controllers, scenarios, _ = row.split("|")
        assert system.title.split(",")[0] in robot
        assert re.findall(r"`(\w+)`", scenarios) == [*system.scenarios]
        assert set(re.findall(r"`(\w+)`", plants)) == {u for u in system.units if is_plant(u)}
        assert set(re.findall(r"`(\w+)`", controllers)) == {u for u in system.units if not is_plant(u)}


def is_plant(unit: str) -> bool:
    return UNITS[unit].block.startswith("handover.plants.")


def test_the_table_of_options_names_every_algorithm():
    (row,) = re.findall(r"^\| `--algorithm` \|(.*)$", README, re.MULTILINE)
    assert {a.value for a in Algorithm} <= {*re.findall(r"`([^`]+)`", row)}


def test_the_table_of_units_has_their_steps_and_standards():
    cells = [row.split("|")[1:4] for row in README.splitlines() if re.match(r"\| `[A-Z][a-z]\w+`", row)]
    sentence = {
        unit: (step.strip(), fmi.strip()) for units, step, fmi in cells for unit in re.findall(r"`(\w+)`", units)
    }
    assert set(sentence) == set(UNITS)
    for name, entry in UNITS.items():
        step, fmi = sentence[name]
        number, unit = step.split()
        assert Fraction(number) * {"ms": Fraction(1, 1000), "s": 1}[unit] == entry.step
        try:
            cached(name, 2)
            assert fmi == "2, 3"
        except NoFmi2Form:
            assert fmi == "3"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a tree that looks like the repository's, in which the units have been built."""
    made = tmp_path_factory.mktemp("repository")
    for name, target in ((".venv", Path(sys.prefix)), ("docs", ROOT / "docs"), ("fmus", ROOT / "fmus")):
        (made / name).symlink_to(target)
    done = handover(command_with(" build TendonArm "), made)
    assert done.returncode == 0, done.stderr
    return made


def test_a_unit_runs_in_fmpy(folder: Path):
    printed = program(IN_FMPY, folder)
    x, y, z = (float(n) for n in printed.strip().strip("[]").split())
    assert (x, y, z) == pytest.approx((0.0, 0.0, -0.7), abs=1e-6)


def test_a_unit_tells_its_terminals(folder: Path):
    done = handover(command_with(" info "), folder)
    assert done.returncode == 0, done.stderr
    listed = [line.split()[:3] for line in done.stdout.partition("\nTerminals")[2].splitlines() if line]
    assert listed == [
        ["wrist", "_handover_pose", "plug"],
        ["gripper", "_handover_pose", "plug"],
        ["actuators", "_handover_command", "plug"],
    ]


def test_whole_units_and_terminals_are_connected(tmp_path: Path):
    lines = program(TERMINALS, tmp_path).splitlines()
    assert lines == [f"robot.{x}_WB -> navigation.{x}_WB (terminal base)" for x in "pqvw"]


@pytest.mark.skipif(sys.platform != "linux" or not interpreter.library(), reason="the program looks for linux64")
def test_a_unit_runs_in_a_c_program(folder: Path):
    script = block_with("./c_host")
    if shutil.which("cc") is None:
        assert ".venv/bin/python -m ziglang cc" in README
        script = script.replace("\ncc ", "\n.venv/bin/python -m ziglang cc ")
    printed = shell(script, folder)
    assert f"prints `{printed.strip()}`" in README


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
    (scalar,) = re.findall(r"`\.venv/bin/(handover build [^`]*--scalar[^`]*)`", README)
    assert handover(scalar, folder).returncode == 0
    assert (folder / "units" / "TendonArm.fmi3-scalar.fmu").is_file()


def test_the_unit_passes_its_check(folder: Path):
    done = handover(command_with(" check units/TendonArm"), folder)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_a_unit_brings_an_experiment_along_that_its_check_repeats(folder: Path):
    done = handover(command_with(" --prove "), folder)
    assert done.returncode == 0, done.stderr
    done = handover(command_with(" check units/FreeFlyer"), folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "outputs compared, all equal" in done.stdout


@pytest.mark.slow
def test_a_unit_is_built_for_all_platforms(folder: Path):
    done = handover(command_with(" --platform all "), folder)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(folder / "units" / "Push.fmi3.fmu") as archive:
        libraries = [name for name in archive.namelist() if name.startswith("binaries/")]
    assert len(libraries) == len(TARGETS)


@pytest.mark.slow
def test_a_unit_brings_its_interpreter(folder: Path):
    done = handover(command_with(" --standalone "), folder)
    assert done.returncode == 0, done.stderr
    (size,) = re.findall(r"`units/Push.fmi3-standalone.fmu`, (\d+) MB", README)
    file = folder / "units" / "Push.fmi3-standalone.fmu"
    assert file.stat().st_size < 40e6
    assert file.stat().st_size == pytest.approx(1e6 * float(size), rel=0.1)


@pytest.mark.slow
def test_data_beside_a_unit_goes_along_with_it(tmp_path: Path):
    (option,) = re.findall(r"`(--include (?:\S+))`", README)
    file = option.split()[1]
    read = f"        self.k = params.k * float(Path(__file__).with_name({file!r}).read_text())\n"
    block = OWN_BLOCK.replace("        self.k = params.k\n", read)
    assert read in block
    (tmp_path / "tabled.py").write_text(f"from pathlib import Path\n\n{block}")
    (tmp_path / file).write_text("2.0")
    for out, given in (("with", option), ("without", "")):
        done = handover(f"handover build tabled:Spring --fmi 3 --platform host {given} --out {out}", tmp_path)
        assert done.returncode == 0, done.stderr
    (tmp_path / file).unlink()
    checks = [handover(f"handover check {out}/Spring.fmi3.fmu", tmp_path) for out in ("with", "without")]
    assert [done.returncode for done in checks] == [0, 1]
    assert file in checks[1].stdout


def test_what_a_unit_in_another_tool_needs_is_run_here_or_an_extra():
    """Commands of this package are counted above; programs of others are run as the whole blocks in which they are."""
    section = README.partition("\n## A unit in another tool\n")[2].partition("\n## ")[0]
    blocks = [text for kind, text in BLOCKS if not kind and text in section]
    lines = {line for text in blocks for line in text.splitlines() if not line.startswith(".venv/bin/handover ")}
    others = lines - {*block_with("./c_host").splitlines(), *block_with("./ecos ").splitlines()}
    install = re.compile(r'[.]venv/bin/python -m pip install --editable "[.]\[(\w+)\]"')
    extras = {found[1] if (found := install.fullmatch(line)) else line for line in others}
    assert extras == {"cross", "standalone"}
    assert extras <= {*re.findall(r"^(\w+) = \[", (ROOT / "pyproject.toml").read_text(), flags=re.MULTILINE)}


def command_with(part: str) -> str:
    (command,) = (c for c in COMMANDS if part in c)
    return command


def block_with(part: str) -> str:
    (block,) = (text for kind, text in BLOCKS if not kind and part in text)
    return block


def shell(script: str, folder: Path) -> str:
    call = ["sh", "-e", "-c", script]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_scenario_is_run_from_python(tmp_path: Path):
    assert len(IN_PYTHON.split("\n\n")[1].splitlines()) + 1 <= 5  # lines of program
    assert program(IN_PYTHON, tmp_path).startswith("True closed at ")
    assert (tmp_path / "hand.png").is_file()
    assert len([*tmp_path.glob("runs/*/signals.parquet")]) == 1


def test_a_scenario_is_stepped_from_python(tmp_path: Path):
    assert program(STEPS, tmp_path).startswith("3.008 [")


def test_an_agent_takes_a_units_place(tmp_path: Path):
    assert "Box(-inf, inf, (3,), float64)" in program(AGENT, tmp_path)


def test_a_system_of_ones_own_is_co_simulated(tmp_path: Path):
    printed = program(OWN_SYSTEM, tmp_path)
    assert printed.strip() == "[0.25 0.   0.  ]"
    assert (tmp_path / "push" / "signals.parquet").is_file()


def test_a_block_of_ones_own_is_built(tmp_path: Path):
    (tmp_path / "spring.py").write_text(OWN_BLOCK)
    printed = program(OWN_BUILD, tmp_path)
    assert (tmp_path / printed.strip()).is_file()
    (command,) = re.findall(r"`\.venv/bin/(handover build spring:Spring [^`]*)`", README)
    done = handover(command, tmp_path)
    assert done.returncode == 0, done.stderr
    assert printed.strip() in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("command", RUNS)
def test_the_runs_succeed(command: str, tmp_path: Path):
    needed = [" build TendonArm ", " vsl-train "] if "units/" in command or "vsl_model.json" in command else []
    needed += [" export "] if ".ssp" in command else []
    for before in (c for c in COMMANDS if any(word in c for word in needed)):
        assert handover(before, tmp_path).returncode == 0
    if "--input" in command:
        shell("".join(line + "\n" for line in block_with(command).splitlines() if line.startswith("printf ")), tmp_path)
    done = handover(command, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "succeeded" in done.stdout
    again, filmed = command_with(" report "), command_with(" film ")
    if command.endswith(f" --out {again.split()[-1]}"):
        assert handover(again, tmp_path).returncode == 0
        done = handover(filmed, tmp_path) if shutil.which("chromium") else done
        assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", [c for c in COMMANDS if " sweep " in c or " paper " in c])
def test_the_campaigns_end(command: str, tmp_path: Path):
    done = handover(command, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    tables = [*tmp_path.glob("*/runs.parquet"), *tmp_path.glob("campaigns/*/runs.parquet")]
    assert len(tables) == 1
    assert (tables[0].parent / "report.html").is_file()


@pytest.mark.slow
def test_campaigns_are_compared(tmp_path: Path):
    block = block_with(" compare ")
    for command in block.splitlines():
        done = handover(command, tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
    comparison = tmp_path / command_with(" compare ").split()[-1]
    assert {"report.html", "comparison.csv", "comparison.json", "figures"} == {p.name for p in comparison.iterdir()}
    found = json.loads((comparison / "comparison.json").read_bytes())
    assert all(test["paired"] for test in found["tests"])  # "run by run where they share seeds, as these do"
    assert {p.suffix for p in (comparison / "figures").iterdir()} == {".png", ".svg"}


def test_the_plan_of_a_study_is_written_and_checked(tmp_path: Path):
    new, check = (c for c in COMMANDS if " study " in c)
    assert handover(new, tmp_path).returncode == 0
    done = handover(check, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "12" in done.stdout
