"""All that the tutorial promises, in an environment that has the project's wheel and no clone of it.

What the wheel requires is linked from this environment, at first what it requires without extras alone.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fmus.wheels import ROOT, build_wheel, copy_sources
from support.installed import distributions, link_distributions
from support.scenarios.tutorial import SCENE, write_files

from handover.cosim.native_libraries import host_platform
from handover.cosim.record.reader import Record

pytestmark = pytest.mark.slow

OTHER_SETTINGS = ("PYTHON", "VIRTUAL_ENV", "HANDOVER")


@dataclass(frozen=True)
class Installation:
    """A virtual environment, and a folder with nothing but what its user wrote."""

    environment: Path
    here: Path

    @property
    def packages(self) -> Path:
        (found,) = self.environment.glob("lib/python*/site-packages")
        return found

    def start(self, *arguments: str, program: str = "handover") -> "subprocess.Popen[str]":
        command, pipe = [self.environment / "bin" / program, *arguments], subprocess.PIPE
        return subprocess.Popen(command, cwd=self.here, env=self.settings, stdout=pipe, stderr=pipe, text=True)

    def call(self, *arguments: str, program: str = "handover") -> "tuple[int, str, str]":
        """Return status, output and messages of a command."""
        going = self.start(*arguments, program=program)
        output, errors = going.communicate(timeout=600)
        return going.returncode, output, errors

    def succeeded(self, *arguments: str, program: str = "handover") -> str:
        status, output, errors = self.call(*arguments, program=program)
        assert status == 0, errors + output
        return output

    def killed(self, *arguments: str, once: str) -> None:
        """Call the command, and kill it by SIGKILL once a file is there that matches a pattern."""
        running = self.start(*arguments)
        deadline = time.monotonic() + 300
        while not any(self.here.glob(once)):
            assert running.poll() is None, running.communicate()
            assert time.monotonic() < deadline, f"there was no {once}"
            time.sleep(0.02)
        running.kill()
        running.communicate()
        assert running.returncode == -signal.SIGKILL, f"it had ended before there was a {once}"

    @property
    def settings(self) -> "dict[str, str]":
        own = {name: value for name, value in os.environ.items() if not name.startswith(OTHER_SETTINGS)}
        return {**own, "HANDOVER_CACHE": str(self.environment / "cache"), "PYTHONNOUSERSITE": "1"}

    def signals(self, folder: str) -> bytes:
        return (self.here / folder / "signals.parquet").read_bytes()

    def data(self, file: str) -> Any:
        return json.loads((self.here / file).read_text())

    def distance(self, folder: str) -> float:
        """Return the metric `distance` of a run's summary."""
        return float(self.data(f"{folder}/summary.json")["metrics"]["distance"]["value"])


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Generator[Installation, None, None]:
    """Give an environment with the wheel, without extras, and the tutorial's files in a folder that was empty."""
    folder = tmp_path_factory.mktemp("alone")
    wheel = build_wheel(copy_sources(folder / "checkout" / "handover"), host_platform())
    made = Installation(folder / "environment", folder / "mine")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", made.environment], check=True)
    link_distributions(distributions("handover-cosim") - {"handover-cosim"}, made.packages)
    pip = [sys.executable, "-m", "pip", "--python", str(made.environment / "bin" / "python")]
    subprocess.run([*pip, "install", "--quiet", "--no-deps", "--no-compile", wheel], check=True)
    made.here.mkdir()
    write_files(made.here)
    yield made
    shutil.rmtree(made.environment)


@pytest.fixture(scope="module")
def without_extras(bare: Installation) -> "Sequence[tuple[int, str, str]]":
    """Return what commands did before any extra was installed."""
    run = ("run", SCENE, "--no-report", "--out", "without_extras")
    return [bare.call(*call) for call in (run, ("run", SCENE, "--out", "x"), ("sweep", SCENE, "--out", "x"))]


@pytest.fixture(scope="module")
def own(bare: Installation, without_extras: object) -> Installation:  # noqa: ARG001
    """Return the environment with all extras, in which the scenario has been run into `first`."""
    link_distributions(distributions("handover-cosim", ["all"]) - {"handover-cosim"}, bare.packages)
    assert "two_link_reach succeeded" in bare.succeeded("run", SCENE, "--out", "first")
    return bare


def test_nothing_of_a_clone_is_on_its_path(bare: Installation):
    line = "import sys, handover; print(handover.__file__, *sys.path, sep='\\n')"
    found = bare.succeeded("-c", line, program="python").splitlines()
    assert found[0].startswith(str(bare.environment))
    assert not [path for path in found if path.startswith(str(ROOT))]


def test_without_extras_it_runs_and_what_lacks_is_named(
    bare: Installation, without_extras: "Sequence[tuple[int, str, str]]"
):
    ran, reported, swept = without_extras
    assert ran[0] == 0, ran
    assert "two_link_reach succeeded" in ran[1]
    for (status, _, errors), extra in ((reported, "reports"), (swept, "campaigns")):
        assert status == 2
        (line,) = errors.splitlines()
        assert f'"handover-cosim[{extra}]"' in line
    assert not (bare.here / "x").exists()


def test_a_run_has_its_record_and_a_page_with_a_replay(own: Installation):
    record = Record(own.here / "first" / "signals.parquet")
    off = float(np.linalg.norm(record["arm.p_WE"][-1] - [0.3, 0.6]))
    assert off == own.distance("first") < 0.005
    assert own.signals("first") == own.signals("without_extras")
    assert '<section id="replay">' in (own.here / "first" / "report.html").read_text(encoding="utf-8")
    assert (own.here / "first" / "figures" / "distance.png").is_file()


def test_campaigns_of_which_one_was_killed_are_compared_with_the_numbers_of_their_runs(own: Installation):
    campaigns = ("stiff", "soft")
    sweep = ["sweep", SCENE, "arm.mass=1,2", "--repeat", "2", "--no-report"]
    stiff = [*sweep, "--workers", "1", "--pace", "4", "--out", "stiff"]
    own.killed(*stiff, once="stiff/runs/0*/summary.json")
    done = {file: file.stat().st_mtime_ns for file in own.here.glob("stiff/runs/0*/summary.json")}
    assert 0 < len(done) < 4
    assert "4 of 4 runs done" in own.succeeded(*stiff)
    assert {file: file.stat().st_mtime_ns for file in done} == done
    own.succeeded(*sweep, "--workers", "2", "--unit", "controller=softer:Softer", "--out", "soft")
    assert "they differ in: controller" in own.succeeded("compare", *campaigns, "--out", "both")
    assert {file.suffix for file in (own.here / "both" / "figures").iterdir()} == {".png", ".svg"}
    compared = own.data("both/comparison.json")
    assert [point["parameters"] for point in compared["points"]] == [{"arm.mass": "1"}, {"arm.mass": "2"}]
    runs = {
        name: sorted(f"{name}/runs/{run.name}" for run in (own.here / name / "runs").iterdir()) for name in campaigns
    }
    for k, point in enumerate(compared["points"]):
        for name in campaigns:
            assert point["campaigns"][name]["done"] == 2
            of_point = {own.distance(run) for run in runs[name][2 * k : 2 * k + 2]}
            assert of_point == {point["campaigns"][name]["metrics"]["distance"]["median"]}
    assert own.signals(runs["stiff"][0]) == own.signals("first") != own.signals(runs["stiff"][2])
    other = ["-p", "arm.mass=2", "--unit", "controller=softer:Softer"]
    own.succeeded("run", SCENE, *other, "--no-report", "--out", "heavy_and_soft")
    assert own.signals(runs["soft"][2]) == own.signals("heavy_and_soft")


def test_its_ssp_is_sound_and_runs_like_it(own: Installation):
    own.succeeded("export", SCENE, "--ssp", "reach.ssp")
    reports = json.loads(own.succeeded("check", "reach.ssp", "--json"))
    assert len(reports) == 1 + 2  # with its units
    assert all(report["passed"] for report in reports)
    own.succeeded("run", "reach.ssp", "--no-report", "--out", "exported")
    ours, theirs = (Record(own.here / name / "signals.parquet") for name in ("first", "exported"))
    assert theirs.time[-1] == 5.0
    assert len(ours.time) < len(theirs.time)
    for name in ours.signals:
        np.testing.assert_array_equal(theirs[name][: len(ours.time)], ours[name])
