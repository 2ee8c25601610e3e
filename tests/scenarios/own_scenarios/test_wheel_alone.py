"""All that the tutorial promises, in an environment that has the project's wheel and no clone of it."""

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
from tutorial import SOFTER, write_files
from wheels import ROOT, build_wheel, copy_sources

from handover.cosim.native_libraries import host_platform
from handover.cosim.record.reader import Record

pytestmark = pytest.mark.slow

SCENE = "reach:TwoLinkReach"
OTHER_SETTINGS = ("PYTHON", "VIRTUAL_ENV", "HANDOVER")


@dataclass(frozen=True)
class Installation:
    """A virtual environment, and a folder with nothing but what its user wrote."""

    environment: Path
    here: Path

    def install(self, wheel: Path, extras: str = "") -> None:
        packages = ["--constraint", str(ROOT / "constraints.txt"), f"{wheel}{extras}"]
        self.python("-m", "pip", "install", "--quiet", "--no-compile", *packages)

    def python(self, *arguments: str) -> str:
        python = self.environment / "bin" / "python"
        done = subprocess.run([python, *arguments], cwd=self.here, env=self.settings, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def call(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        command = [self.environment / "bin" / "handover", *arguments]
        return subprocess.run(
            command, cwd=self.here, env=self.settings, capture_output=True, text=True, timeout=300, check=False
        )

    def succeeded(self, *arguments: str) -> str:
        done = self.call(*arguments)
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout

    def killed(self, *arguments: str, once: str) -> None:
        """Call the command, and kill it by SIGKILL once a file is there that matches a pattern."""
        command = [self.environment / "bin" / "handover", *arguments]
        running = subprocess.Popen(
            command, cwd=self.here, env=self.settings, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 120
        while not any(self.here.glob(once)) and time.monotonic() < deadline:
            time.sleep(0.02)
        running.kill()
        assert running.wait() == -signal.SIGKILL, f"it had ended before there was a {once}"

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
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wheel(copy_sources(tmp_path_factory.mktemp("checkout") / "handover"), host_platform())


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Generator[Installation, None, None]:
    """Give an environment with the wheel, without extras, and the tutorial's files in a folder that was empty."""
    folder = tmp_path_factory.mktemp("alone")
    made = Installation(folder / "environment", folder / "mine")
    subprocess.run([sys.executable, "-m", "venv", made.environment], check=True)
    made.here.mkdir()
    made.install(wheel)
    write_files(made.here)
    (made.here / "softer.py").write_text(SOFTER)
    yield made
    shutil.rmtree(made.environment)  # a gigabyte


@pytest.fixture(scope="module")
def without_extras(bare: Installation) -> "Sequence[subprocess.CompletedProcess[str]]":
    """Return what commands did before any extra was installed."""
    run = ("run", SCENE, "--no-report", "--out", "without_extras")
    return [bare.call(*run), bare.call("run", SCENE, "--out", "x"), bare.call("sweep", SCENE, "--out", "x")]


@pytest.fixture(scope="module")
def own(bare: Installation, without_extras: object, wheel: Path) -> Installation:  # noqa: ARG001
    """Return the environment with all extras, in which the scenario has been run into `first`."""
    bare.install(wheel, "[all]")
    assert "two_link_reach succeeded" in bare.succeeded("run", SCENE, "--out", "first")
    return bare


@pytest.fixture(scope="module")
def campaigns(own: Installation) -> "Sequence[str]":
    """Return the folders of two campaigns with the same points and seeds, of which the first is killed and goes on."""
    sweep = ["sweep", SCENE, "arm.mass=1,2", "--repeat", "3", "--pace", "4", "--workers", "2", "--no-report"]
    own.killed(*sweep, "--out", "stiff", once="stiff/runs/0*/summary.json")
    done = {file: file.stat().st_mtime_ns for file in own.here.glob("stiff/runs/0*/summary.json")}
    assert 0 < len(done) < 6
    assert "6 of 6 runs done" in own.succeeded(*sweep, "--out", "stiff")
    assert {file: file.stat().st_mtime_ns for file in done} == done
    own.succeeded(*sweep, "--unit", "controller=softer:Softer", "--out", "soft")
    return ("stiff", "soft")


def test_nothing_of_a_clone_is_on_its_path(bare: Installation):
    found = bare.python("-c", "import sys, handover; print(handover.__file__, *sys.path, sep='\\n')").splitlines()
    assert found[0].startswith(str(bare.environment))
    assert not [path for path in found if path.startswith(str(ROOT))]


def test_without_extras_it_runs_and_what_lacks_is_named(
    bare: Installation, without_extras: "Sequence[subprocess.CompletedProcess[str]]"
):
    ran, reported, swept = without_extras
    assert ran.returncode == 0, ran.stderr
    assert "two_link_reach succeeded" in ran.stdout
    for refused, extra in ((reported, "reports"), (swept, "campaigns")):
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        assert f'"handover-cosim[{extra}]"' in line
    assert not (bare.here / "x").exists()


def test_a_run_has_its_record_and_a_page_with_a_replay(own: Installation):
    record = Record(own.here / "first" / "signals.parquet")
    off = float(np.linalg.norm(record["arm.p_WE"][-1] - [0.3, 0.6]))
    assert off == own.distance("first") < 0.005
    assert own.signals("first") == own.signals("without_extras")
    page = own.here / "first" / "report.html"
    page.unlink()
    own.succeeded("report", "first", "--trust", "reach.py")
    html = page.read_text(encoding="utf-8")
    assert '<section id="replay">' in html
    for label in ("arm", "path of the tip", "goal"):
        assert f'"label":"{label}"' in html


def test_units_and_parameters_are_swept_with_the_numbers_of_single_runs(own: Installation):
    units = ["--unit", "controller=goal_spring:SpringToGoal,softer:Softer"]
    printed = own.succeeded("sweep", SCENE, "arm.mass=1,2", *units, "--workers", "2", "--out", "swept")
    assert "4 of 4 runs done" in printed
    runs = sorted(folder.name for folder in (own.here / "swept" / "runs").iterdir())
    values = [
        f"controller={name}_arm.mass={mass}"
        for name in ("goal_spring-SpringToGoal", "softer-Softer")
        for mass in (1, 2)
    ]
    assert runs == [f"{k:03}_{value}_r0000" for k, value in enumerate(values)]
    other = ["-p", "arm.mass=2", "--unit", "controller=softer:Softer"]
    own.succeeded("run", SCENE, *other, "--no-report", "--out", "heavy_and_soft")
    assert own.signals(f"swept/runs/{runs[0]}") == own.signals("first")
    assert own.signals(f"swept/runs/{runs[3]}") == own.signals("heavy_and_soft")
    assert len({own.signals(f"swept/runs/{run}") for run in runs}) == 4
    assert "softer:Softer" in (own.here / "swept" / "report.html").read_text(encoding="utf-8")


def test_a_run_that_was_killed_is_resumed_to_the_same_bytes(own: Installation):
    run = ["run", SCENE, "--no-report", "--checkpoint", "0.2", "--pace", "1", "--out", "killed"]
    own.killed(*run, once="killed/checkpoint.zip")
    assert not (own.here / "killed" / "summary.json").exists()
    assert "two_link_reach succeeded" in own.succeeded("resume", "killed", "--no-report")
    assert own.signals("killed") == own.signals("first")
    assert own.distance("killed") == own.distance("first")


def test_campaigns_are_compared_with_the_numbers_of_their_runs(own: Installation, campaigns: "Sequence[str]"):
    assert "they differ in: controller" in own.succeeded("compare", *campaigns, "--out", "both")
    page = (own.here / "both" / "report.html").read_text(encoding="utf-8")
    assert "stiff" in page
    assert "soft" in page
    assert {file.suffix for file in (own.here / "both" / "figures").iterdir()} == {".png", ".svg"}
    compared = own.data("both/comparison.json")
    assert [point["parameters"] for point in compared["points"]] == [{"arm.mass": "1"}, {"arm.mass": "2"}]
    for k, point in enumerate(compared["points"]):
        for name in campaigns:
            runs = [f"{name}/runs/{folder.name}" for folder in (own.here / name / "runs").glob(f"00{k}_*")]
            assert len(runs) == point["campaigns"][name]["done"] == 3
            assert {own.distance(run) for run in runs} == {point["campaigns"][name]["metrics"]["distance"]["median"]}
    medians = [point["campaigns"]["stiff"]["metrics"]["distance"]["median"] for point in compared["points"]]
    assert medians[0] == own.distance("first") != medians[1]


def test_its_ssp_is_sound_and_runs_like_it(own: Installation):
    own.succeeded("export", SCENE, "--ssp", "reach.ssp")
    reports = json.loads(own.succeeded("check", "reach.ssp", "--json"))
    units = ["resources/SpringToGoal.fmi2.fmu", "resources/TwoLinkArm.fmi2.fmu"]
    assert sorted(report["file"] for report in reports) == ["reach.ssp", *(f"reach.ssp/{unit}" for unit in units)]
    assert all(report["passed"] for report in reports)
    own.succeeded("run", "reach.ssp", "--no-report", "--out", "exported")
    ours, theirs = (Record(own.here / name / "signals.parquet") for name in ("first", "exported"))
    assert theirs.time[-1] == 5.0
    assert len(ours.time) < len(theirs.time)
    for name in ours.signals:
        np.testing.assert_array_equal(theirs[name][: len(ours.time)], ours[name])
