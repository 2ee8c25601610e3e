"""Files that people give are read only if they are regular: a pipe waits for a writer, and a device never ends."""

import os
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.model_text import read_model
from handover.controllers.vsl.waypoints import read_waypoints
from handover.cosim.exceptions import InvalidFmu, RecordNotWritten
from handover.cosim.fmu.file.description import describe_fmu
from handover.fmus.contents.reference_experiment import read_stimulus
from handover.plants.free_flyer.hand.hand_track import read_track
from handover.scenarios.cli.config_file import read_config
from handover.scenarios.robots.vsl.data_file import read_data
from handover.scenarios.runs.execution.input_file import read_inputs
from handover.scenarios.runs.results.run_folder import write_whole
from handover.scenarios.study.plan.plan import read_plan

READERS: dict[str, Callable[[Path], object]] = {
    "configuration": lambda file: read_config(file, click.Context(click.Command("run"))),
    "hand track": lambda file: read_track(file, 0.2),
    "inputs": lambda file: read_inputs(file, {}, {}),
    "plan": read_plan,
    "stimulus": lambda file: read_stimulus(file, {}),
    "unit": describe_fmu,
    "VSL model": read_model,
    "VSL points": lambda file: read_data(file, VslKinematics(0.1, 0.1, 0.1, Elbow.UP)),
    "waypoints": read_waypoints,
}

FAULTS = (OSError, ValueError, InvalidFmu)


@pytest.mark.skipif(os.name == "nt", reason="needs pipes and devices")
@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_and_a_device_are_refused_at_once(reader: str, tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    for name in ("pipe", "device"):
        with pytest.raises((*FAULTS, click.ClickException), match=r"a device or a pipe|not a regular file"):
            READERS[reader](tmp_path / name)


@pytest.mark.skipif(os.name == "nt", reason="needs pipes")
def test_a_file_that_is_written_takes_the_place_of_no_device_or_pipe(tmp_path: Path):
    full, pipe = tmp_path / "full", tmp_path / "pipe"
    full.symlink_to("/dev/full")
    os.mkfifo(pipe)
    for path in (full, pipe):
        with pytest.raises(RecordNotWritten, match="it is a device or a pipe, not a file"):
            write_whole(path, "text")
    assert full.is_symlink()
    assert pipe.is_fifo()
