"""All that the tutorial promises, in an environment that has the project's wheel and no clone of it.

What the wheel requires is linked from this environment, at first what it requires without extras alone.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

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

    def call(self, *arguments: str, program: str = "handover") -> "subprocess.CompletedProcess[str]":
        command = [self.environment / "bin" / program, *arguments]
        own = {name: value for name, value in os.environ.items() if not name.startswith(OTHER_SETTINGS)}
        settings = {**own, "HANDOVER_CACHE": str(self.environment / "cache"), "PYTHONNOUSERSITE": "1"}
        return subprocess.run(
            command, cwd=self.here, env=settings, capture_output=True, text=True, timeout=600, check=False
        )

    def succeeded(self, *arguments: str, program: str = "handover") -> str:
        done = self.call(*arguments, program=program)
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout


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
def without_extras(bare: Installation) -> "Sequence[subprocess.CompletedProcess[str]]":
    """Return what commands did before any extra was installed."""
    run = ("run", SCENE, "--no-report", "--out", "without_extras")
    return [bare.call(*call) for call in (run, ("run", SCENE, "--out", "x"), ("sweep", SCENE, "--out", "x"))]


@pytest.fixture(scope="module")
def own(bare: Installation, without_extras: object) -> Installation:  # noqa: ARG001
    """Return the environment with all extras."""
    link_distributions(distributions("handover-cosim", ["all"]) - {"handover-cosim"}, bare.packages)
    return bare


def test_nothing_of_a_clone_is_on_its_path(bare: Installation):
    line = "import sys, handover; print(handover.__file__, *sys.path, sep='\\n')"
    found = bare.succeeded("-c", line, program="python").splitlines()
    assert found[0].startswith(str(bare.environment))
    assert not [path for path in found if path.startswith(str(ROOT))]


def test_without_extras_it_runs_and_what_lacks_is_named(
    bare: Installation, without_extras: "Sequence[subprocess.CompletedProcess[str]]"
):
    ran, reported, swept = without_extras
    assert ran.returncode == 0, ran
    assert "two_link_reach succeeded" in ran.stdout
    for done, extra in ((reported, "reports"), (swept, "campaigns")):
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert f'"handover-cosim[{extra}]"' in line
    assert not (bare.here / "x").exists()


def test_a_run_has_its_record_and_a_page_with_a_replay_and_so_has_its_ssp(own: Installation):
    assert "two_link_reach succeeded" in own.succeeded("run", SCENE, "--out", "first")
    signals = own.here / "first" / "signals.parquet"
    assert np.linalg.norm(Record(signals)["arm.p_WG"][-1] - [0.3, 0.6]) < 0.005
    assert signals.read_bytes() == (own.here / "without_extras" / "signals.parquet").read_bytes()
    assert '<section id="replay">' in (own.here / "first" / "report.html").read_text(encoding="utf-8")
    assert (own.here / "first" / "figures" / "distance.png").is_file()
    own.succeeded("export", SCENE, "--ssp", "reach.ssp")
    reports = json.loads(own.succeeded("check", "reach.ssp", "--json"))
    assert [report["passed"] for report in reports] == [True] * 3  # with its units
    own.succeeded("run", "reach.ssp", "--no-report", "--out", "exported")
    ours, theirs = (Record(own.here / name / "signals.parquet") for name in ("first", "exported"))
    for name in ours.signals:
        np.testing.assert_array_equal(theirs[name][: len(ours.time)], ours[name])


def test_a_campaign_is_carried_out_and_its_runs_are_compared(own: Installation):
    units = "controller=goal_spring:SpringToGoal,softer:Softer"
    sweep = ("sweep", SCENE, "--unit", units, "--stop", "0.2", "--workers", "1", "--out", "c")
    assert "2 of 2 runs done" in own.succeeded(*sweep)
    assert (own.here / "c" / "report.html").is_file()
    stiff, soft = sorted((own.here / "c" / "runs").iterdir())
    assert "they differ in: controller" in own.succeeded("compare", str(stiff), str(soft), "--out", "both")
    assert (own.here / "both" / "report.html").is_file()
