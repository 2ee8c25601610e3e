"""Every example in a `--help` runs, or is called with all of the command's checks up to what takes long.

`EXAMPLES` says which is which: the function before which an example is ended, as it would start runs, a browser or a
cluster, or write a page.
"""

import re
import shlex
import shutil
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import click
import pytest
from support.campaigns import campaign_metadata, folder_of, table_of
from support.commands import call
from support.cosim.native_units import native_fmu
from support.kept_runs import copied_run
from support.scenarios.sample_study import same, write_study

from handover.cosim.ssp.writing import write_ssp
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.cli.command import DeferredCommand, main


class Started(BaseException):
    """A command would start what takes long."""


CLI, CAMPAIGNS, STUDY = "handover.scenarios.cli.", "handover.scenarios.campaign.", "handover.scenarios.study."
RUN, SWEEP, PLAY, FILM = CLI + "run.run_task", CLI + "campaign._run", CLI + "play._serve", CLI + "film._film"
COMPARE = "handover.scenarios.comparison.page.write_comparison"
CLUSTER = CAMPAIGNS + "pool_config.PoolConfig.check"
"""Looks for a scheduler at an address that is nobody's here; the plan has been checked then."""


def campaign(path: Path) -> None:
    folder_of(path, campaign_metadata("ir_grasp", [{}]), table_of([{}], moved=[0.1, 0.2]))


def fmu(path: Path) -> None:
    shutil.copyfile(cached("Thrusters", 2), path)


def mass(path: Path) -> None:
    shutil.copyfile(native_fmu("mass", 2), path)


def table(path: Path) -> None:
    path.write_text("time,f_pose[1]\n0,0\n1,0.1\n")


def system(path: Path) -> None:
    masses = System()
    masses.add("mass", native_fmu("mass"))
    write_ssp(masses, path, "masses")


def study(path: Path) -> None:
    ran(write_study(path, 2, same).session(1).run_folder(3))


def described(path: Path) -> None:
    path.mkdir(parents=True)
    (path / "run.json").write_text('{"scenario": "flyer_robot_to_human", "parameters": {}}')
    (path / "signals.parquet").touch()


def ran(path: Path) -> None:
    copied_run(path, "run", "flyer_impedance", "--stop", "0.1", "--no-report")


Needs = Mapping[str, Callable[[Path], None]]
EXAMPLES: Mapping[str, tuple[str, Needs]] = {
    "handover list": ("", {}),
    "handover list helix_handover": ("", {}),
    "handover list VslArm": ("", {}),
    "handover run helix_handover": (RUN, {}),
    "handover run x.ssp --stop 5": (RUN, {"x.ssp": system}),
    "handover run x.fmu --input u.csv --stop 5": (RUN, {"x.fmu": fmu, "u.csv": table}),
    "handover play flyer_impedance": (PLAY, {}),
    "handover resume runs/long": (CLI + "resume.InterruptedRun", {"runs/long": described}),
    "handover sweep ir_grasp strategy=reflex,blind --repeat 20": (SWEEP, {}),
    "handover compare ours theirs": (COMPARE, {"ours": campaign, "theirs": campaign}),
    "handover paper ir-table": (SWEEP, {}),
    "handover report runs/long": (CLI + "report._write_of_run", {"runs/long": described}),
    "handover film runs/long --out x.mp4": (FILM, {"runs/long": described}),
    "handover vsl-train --out model.json": (CLI + "robots.vsl_train._train", {}),
    "handover flyer-track runs/x": (CLI + "robots.flyer_track._write", {"runs/x": described}),
    "handover study new plan.toml": ("", {}),
    "handover new scenario Reach": ("", {}),
    "handover run reach:Reach": (RUN, {}),
    "handover build TendonArm --fmi both": ("", {}),
    "handover export ir_grasp --ssp grasp.ssp": ("", {}),
    "handover info Their.fmu": ("", {"Their.fmu": fmu}),
    "handover check Their.fmu": ("", {"Their.fmu": mass}),
    "handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=reflex --repeat 6 --out ours": (SWEEP, {}),
    "handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=blind --repeat 6 --out theirs": (SWEEP, {}),
    "handover run flyer_impedance -p behaviour=rigid --out a": (RUN, {}),
    "handover run flyer_impedance -p behaviour=compliant --out b": (RUN, {}),
    "handover compare a b --name rigid --name compliant --signal robot.p_WB": (COMPARE, {"a": ran, "b": ran}),
    "handover new controller Gentle": ("", {}),
    "handover run reach:Reach --unit controller=gentle:Gentle": (RUN, {}),
    "handover new controller Mine --for helix_handover:servo": ("", {}),
    "handover sweep ir_grasp strategy=reflex,blind,forward --repeat 20 --paired": (SWEEP, {}),
    "handover sweep helix_handover alpha=0.1:0.4:4 -p patience=30 --out alphas": (SWEEP, {}),
    "handover sweep flyer_impedance force=1:20:10 --scheduler tcp://10.0.0.5:8786": (CLUSTER, {}),
    "handover sweep x.fmu m=1,2,4 k=0:20:5 -p f=1 --stop 10": (SWEEP, {"x.fmu": mass}),
    "handover study plan plan.toml": ("", {}),
    "handover study serve plan.toml --out DIR": (STUDY + "session.served_study.serve_study", {}),
    "handover study power plan.toml": (STUDY + "statistics.power.simulated_power", {}),
    "handover study report DIR": (STUDY + "report.report_page.write_study_report", {"DIR": study}),
    "handover study replay DIR P01 3": ("handover.scenarios.reporting.run_page.write_run_page", {"DIR": study}),
    "handover study export DIR": ("", {"DIR": study}),
    "handover study withdraw DIR P01": ("", {"DIR": study}),
}  # fmt: skip


def all_commands() -> Generator[tuple[str, click.Command], None, None]:
    """Give every command with its whole name, "" for `handover` itself."""

    def below(name: str, command: click.Command) -> Generator[tuple[str, click.Command], None, None]:
        command = command.load() if isinstance(command, DeferredCommand) else command
        yield name, command
        if isinstance(command, click.Group):
            for short, each in command.commands.items():
                yield from below(f"{name} {short}".strip(), each)

    yield from below("", main)


COMMANDS = dict(all_commands())
HELPS: Mapping[str, Sequence[str]] = {
    name: [line[1] for line in re.finditer(r"^  (handover \S.*?)(?:  .*)?$", command.help or "", re.MULTILINE)]
    for name, command in COMMANDS.items()
}
OWNERS = {example: name for name, examples in HELPS.items() for example in examples}
"""By example, the last help that has it: that of `handover` repeats some."""


def test_every_example_of_a_help_is_in_the_table():
    assert {*OWNERS} == {*EXAMPLES}


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Generator[Path, None, None]:
    """Give the working directory; modules in it are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    for name, module in [*sys.modules.items()]:
        if str(getattr(module, "__file__", None) or "").startswith(f"{tmp_path}/"):
            del sys.modules[name]


def start(*_given: Any, **_more: Any) -> NoReturn:
    raise Started


@pytest.mark.usefixtures("empty_figures")
@pytest.mark.parametrize("name", dict.fromkeys(OWNERS.values()))
def test_the_examples_of_a_help_run(name: str, here: Path, monkeypatch: pytest.MonkeyPatch):
    for example in (e for e in HELPS[name] if OWNERS[e] == name):
        starts, needs = EXAMPLES[example]
        for need, make in needs.items():
            if not (here / need).exists():
                make(here / need)
        before = files_in(here)
        with monkeypatch.context() as patched:
            if starts:
                patched.setattr(starts, start)
            try:
                done = call(*shlex.split(example)[1:])
            except Started:
                assert files_in(here) == before
            else:
                assert (done.exit_code, starts) == (0, ""), (example, done.output, done.exception)


def files_in(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if "__pycache__" not in path.parts}


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_that_a_help_names_have_the_options_that_it_gives_them(name: str):
    command = COMMANDS[name]
    for text in [command.help or "", *(p.help or "" for p in command.params if isinstance(p, click.Option))]:
        for quoted in re.findall(r"`handover ([^`]*)`", " ".join(text.split())):
            words = quoted.split()
            known = [n for n in COMMANDS if n and words[: len(n.split())] == n.split()]
            assert known, quoted
            options = {o for p in COMMANDS[max(known, key=len)].params for o in (*p.opts, *p.secondary_opts)}
            assert {w for w in words if w.startswith("-")} <= {*options, "--help", "-h"}, quoted
