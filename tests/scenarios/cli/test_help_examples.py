"""Every example in a `--help` runs, or is checked as far as it can be without what it would start.

`EXAMPLES` says which is which: what takes minutes, a browser or a cluster is called as it stands, with all of the
command's checks, up to the function that would start it.
"""

import re
import shlex
import shutil
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from enum import Enum, auto
from pathlib import Path
from typing import Any, NoReturn

import click
import pytest
from click.testing import CliRunner, Result
from support.campaigns import campaign_metadata, folder_of, table_of
from support.cosim.native_units import native_fmu
from support.kept_runs import copied_run
from support.killed_run import killed_run
from support.scenarios.sample_study import same, write_study

from handover.fmus.build import cached
from handover.scenarios.cli.command import DeferredCommand, main


class How(Enum):
    RUN = auto()
    """As it stands, in process."""
    CHECKED = auto()
    """As it stands, up to what it would start: the function in `STARTS`."""
    SLOW = auto()
    """As it stands, in the slow tier."""


class Started(Exception):
    """A command would start something, by the function that is named."""


STARTS: Mapping[str, str] = {
    "run": "handover.scenarios.cli.run.run_task",
    "sweep": "handover.scenarios.cli.campaign._run",
    "paper": "handover.scenarios.cli.campaign._run",
    "play": "handover.scenarios.cli.play._serve",
    "film": "handover.scenarios.cli.film._film",
    "vsl-train": "handover.scenarios.cli.robots.vsl_train._train",
    "serve": "handover.scenarios.study.session.served_study.serve_study",
}
CLUSTER = "handover.scenarios.campaign.pool_config.PoolConfig.check"
"""Looks for a scheduler at an address that is nobody's here; the plan has been checked then."""


def call(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


def succeeded(*arguments: str) -> None:
    done = call(*arguments)
    assert done.exit_code == 0, (arguments, done.output, done.exception)


def run_of(scenario: str, *given: str) -> Callable[[Path], None]:
    """Return what makes a short run, whose task need not succeed."""

    def make(path: Path) -> None:
        copied_run(path, "run", scenario, "--stop", "0.1", "--no-report", *given)

    return make


def campaign(path: Path) -> None:
    folder_of(path, campaign_metadata("ir_grasp", [{}]), table_of([{}], moved=[0.1, 0.2]))


def fmu(path: Path) -> None:
    shutil.copyfile(cached("Thrusters", 2), path)


def mass(path: Path) -> None:
    shutil.copyfile(native_fmu("mass", 2), path)


def table(path: Path) -> None:
    path.write_text("time,f_pose[1]\n0,0\n1,0.1\n")


def system(path: Path) -> None:
    succeeded("export", "flyer_impedance", "--ssp", f"{path}.ssp")
    Path(f"{path}.ssp").rename(path)


def study(path: Path) -> None:
    HANDOVER(write_study(path, 2, same).session(1).run_folder(3))


def interrupted(path: Path) -> None:
    killed_run(path, 1.0, "run", "flyer_impedance", "--checkpoint", "0.5")


HANDOVER, RIGID, COMPLIANT = (
    run_of("flyer_robot_to_human"),
    run_of("flyer_impedance", "-p", "behaviour=rigid"),
    run_of("flyer_impedance", "-p", "behaviour=compliant"),
)
Needs = Mapping[str, Callable[[Path], None]]
RUN, CHECKED, SLOW = How.RUN, How.CHECKED, How.SLOW

EXAMPLES: Mapping[str, tuple[How, Needs]] = {
    "handover list": (RUN, {}),
    "handover list helix_handover": (RUN, {}),
    "handover list VslArm": (RUN, {}),
    "handover run helix_handover": (CHECKED, {}),
    "handover run x.ssp --stop 5": (CHECKED, {"x.ssp": system}),
    "handover run x.fmu --input u.csv --stop 5": (CHECKED, {"x.fmu": fmu, "u.csv": table}),
    "handover play flyer_impedance": (CHECKED, {}),
    "handover resume runs/long": (SLOW, {"runs/long": interrupted}),
    "handover sweep ir_grasp strategy=reflex,blind --repeat 20": (CHECKED, {}),
    "handover compare ours theirs": (RUN, {"ours": campaign, "theirs": campaign}),
    "handover paper ir-table": (CHECKED, {}),
    "handover report runs/long": (RUN, {"runs/long": HANDOVER}),
    "handover film runs/long --out x.mp4": (CHECKED, {"runs/long": HANDOVER}),
    "handover vsl-train --out model.json": (CHECKED, {}),
    "handover flyer-track runs/x": (RUN, {"runs/x": HANDOVER}),
    "handover study new plan.toml": (RUN, {}),
    "handover new scenario Reach": (RUN, {}),
    "handover run reach:Reach": (CHECKED, {}),
    "handover build TendonArm --fmi both": (RUN, {}),
    "handover export ir_grasp --ssp grasp.ssp": (RUN, {}),
    "handover info Their.fmu": (RUN, {"Their.fmu": fmu}),
    "handover check Their.fmu": (RUN, {"Their.fmu": fmu}),
    "handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=reflex --repeat 6 --out ours": (CHECKED, {}),
    "handover sweep ir_grasp thing=cylinder,baby_cup_a -p strategy=blind --repeat 6 --out theirs": (CHECKED, {}),
    "handover run flyer_impedance -p behaviour=rigid --out a": (CHECKED, {}),
    "handover run flyer_impedance -p behaviour=compliant --out b": (CHECKED, {}),
    "handover compare a b --name rigid --name compliant --signal robot.p_WB": (RUN, {"a": RIGID, "b": COMPLIANT}),
    "handover new controller Gentle": (RUN, {}),
    "handover run reach:Reach --unit controller=gentle:Gentle": (CHECKED, {}),
    "handover new controller Mine --for helix_handover:servo": (RUN, {}),
    "handover sweep ir_grasp strategy=reflex,blind,forward --repeat 20 --paired": (CHECKED, {}),
    "handover sweep helix_handover alpha=0.1:0.4:4 -p patience=30 --out alphas": (CHECKED, {}),
    "handover sweep flyer_impedance force=1:20:10 --scheduler tcp://10.0.0.5:8786": (CHECKED, {}),
    "handover sweep x.fmu m=1,2,4 k=0:20:5 -p f=1 --stop 10": (CHECKED, {"x.fmu": mass}),
    "handover study plan plan.toml": (RUN, {}),
    "handover study serve plan.toml --out DIR": (CHECKED, {}),
    "handover study power plan.toml": (SLOW, {}),
    "handover study report DIR": (RUN, {"DIR": study}),
    "handover study replay DIR P01 3": (RUN, {"DIR": study}),
    "handover study export DIR": (RUN, {"DIR": study}),
    "handover study withdraw DIR P01": (RUN, {"DIR": study}),
}


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


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Callable[[Path], None]], Path]:
    """Return what gives the file or folder that a function makes, which is made once."""
    folder = tmp_path_factory.mktemp("made")
    known: dict[Callable[[Path], None], Path] = {}

    def get(make: Callable[[Path], None]) -> Path:
        if make not in known:
            known[make] = folder / str(len(known))
            make(known[make])
        return known[make]

    return get


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Generator[Path, None, None]:
    """Give the working directory; modules in it are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    for name, module in [*sys.modules.items()]:
        if str(getattr(module, "__file__", None) or "").startswith(f"{tmp_path}/"):
            del sys.modules[name]


def put(here: Path, needs: Needs, made: Callable[[Callable[[Path], None]], Path]) -> None:
    for name, make in needs.items():
        (here / name).parent.mkdir(exist_ok=True)
        if not (here / name).exists():
            source = made(make)
            (shutil.copytree if source.is_dir() else shutil.copyfile)(source, here / name)


@pytest.mark.usefixtures("empty_figures")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n else pytest.mark.slow) for n in dict.fromkeys(OWNERS.values())]
)
def test_the_examples_of_a_help_run(
    name: str, here: Path, made: Callable[[Callable[[Path], None]], Path], monkeypatch: pytest.MonkeyPatch
):
    for example in (e for e in HELPS[name] if OWNERS[e] == name):
        how, needs = EXAMPLES[example]
        arguments = shlex.split(example)[1:]
        if how is How.SLOW:
            continue
        put(here, needs, made)
        if how is How.RUN:
            succeeded(*arguments)
            continue
        command = next(word for word in arguments if word in STARTS)
        function = CLUSTER if "--scheduler" in arguments else STARTS[command]
        with monkeypatch.context() as patched:
            patched.setattr(function, starter_of(function))
            before = files_in(here)
            done = call(*arguments)
        assert isinstance(done.exception, Started), (example, done.output, done.exception)
        assert files_in(here) == before


def files_in(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if "__pycache__" not in path.parts}


def starter_of(function: str) -> Callable[..., NoReturn]:
    def start(*_given: Any, **_more: Any) -> NoReturn:
        raise Started(function)

    return start


@pytest.mark.slow
@pytest.mark.parametrize("example", [e for e, (how, _) in EXAMPLES.items() if how is How.SLOW])
def test_examples_that_take_long_run(example: str, here: Path, made: Callable[[Callable[[Path], None]], Path]):
    succeeded("study", "new", "plan.toml")
    put(here, EXAMPLES[example][1], made)
    succeeded(*shlex.split(example)[1:])


def texts_of(command: click.Command) -> Sequence[str]:
    """Return what a command's help says, that of its options included."""
    return [command.help or "", *(p.help or "" for p in command.params if isinstance(p, click.Option))]


@pytest.mark.parametrize("name", COMMANDS)
def test_commands_that_a_help_names_have_the_options_that_it_gives_them(name: str):
    for text in texts_of(COMMANDS[name]):
        for quoted in re.findall(r"`handover ([^`]*)`", " ".join(text.split())):
            words = quoted.split()
            known = [n for n in COMMANDS if n and words[: len(n.split())] == n.split()]
            assert known, quoted
            options = {o for p in COMMANDS[max(known, key=len)].params for o in (*p.opts, *p.secondary_opts)}
            assert {w for w in words if w.startswith("-")} <= {*options, "--help", "-h"}, quoted
