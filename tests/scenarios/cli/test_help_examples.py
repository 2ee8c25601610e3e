"""Every example in a `--help` is parsed; it runs, or is checked up to what it would start, if it needs no file."""

import re
import shlex
import sys
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import click
import pytest
from support.commands import call

from handover.scenarios.cli.command import DeferredCommand, main

SWEEP = "handover.scenarios.cli.campaign._run"
STARTS = {
    "run": "handover.scenarios.cli.run.run_task",
    "sweep": SWEEP,
    "paper": SWEEP,
    "play": "handover.scenarios.cli.play._serve",
    "vsl-train": "handover.scenarios.cli.robots.vsl_train._train",
    "study serve": "handover.scenarios.study.session.served_study.serve_study",
    "study power": "handover.scenarios.study.statistics.power.simulated_power",
}
"""By command the function that an example would start, before which it is ended."""
CLUSTER = "handover.scenarios.runs.campaign.pools.PoolConfig.check"
"""Looks for a scheduler at an address that is nobody's here; the plan has been checked then."""
RUN = ("list", "new", "build", "export", "study new", "study plan")


class Started(BaseException):
    """A command would start what takes long."""


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


@pytest.mark.parametrize("name", dict.fromkeys(OWNERS.values()))
def test_the_examples_of_a_help_run(name: str, here: Path, monkeypatch: pytest.MonkeyPatch):
    for example in (e for e in HELPS[name] if OWNERS[e] == name):
        words = shlex.split(example)[1:]
        known = max((n for n in COMMANDS if words[: len(n.split())] == n.split()), key=len)
        COMMANDS[known].make_context(known, words[len(known.split()) :])
        of_file = re.search(r"\.(fmu|ssp)( |$)", example.partition(" --ssp")[0])
        if of_file or known not in (*STARTS, *RUN):
            continue
        before = files_in(here)
        with monkeypatch.context() as patched:
            if starts := CLUSTER if "--scheduler" in words else STARTS.get(known, ""):
                patched.setattr(starts, start)
            try:
                done = call(*words)
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
