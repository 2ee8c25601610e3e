"""Points made up to learn from, and the command that learns."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from click.testing import CliRunner, Result

from handover.controllers.vsl.hybrid_kinematics import shipped_file
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import VslModel
from handover.controllers.vsl.model_text import read_model
from handover.cosim.blocks.ports import Floats
from handover.fmus.build import cached
from handover.scenarios.cli.robots.vsl_train import vsl_train
from handover.scenarios.robots.vsl.training import VslTraining
from handover.scenarios.robots.vsl.training_data import Dataset, Measured


class Trained(NamedTuple):
    """A model of 400 points of seed 1, the points' file, and what the command printed."""

    model: Path
    data: Path
    output: str


ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)


TRAINING = VslTraining(fmu=Path("none"), kinematics=ARM, points=0, seed=0)


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(vsl_train, [str(a) for a in arguments])


def points(n: int, droop: Floats, sag: Floats) -> Dataset:
    """Return points of an arm whose joints droop, and whose tip hangs off where they put it, in its own plane."""
    rng = np.random.default_rng(2)
    q_cmd = np.column_stack([rng.uniform(-0.5, 0.5, n), rng.uniform(0.2, 0.9, n), rng.uniform(-1.6, -0.8, n)])
    q = q_cmd + droop
    c, s = np.cos(q[:, 0]), np.sin(q[:, 0])
    in_W = np.column_stack([c * sag[0] - s * sag[1], s * sag[0] + c * sag[1], np.full(n, sag[2])])
    p_WG = np.array([ARM.forward(x) for x in q]) + in_W
    return Dataset(p_WG, rng.uniform(5e4, 2e5, (n, 2)), rng.uniform(-1.0, 1.0, (n, 3)), q, q_cmd)


def nobody(_done: float, _of: float) -> None:
    """Take note of no progress."""


def made_up(n: int, seed: int = 2) -> Measured:
    """Return points with a sag that depends on pressures and currents, every tenth unusable."""
    data = points(n, np.array([0.0, -0.01, -0.01]), np.zeros(3))
    data = replace(
        data, p_WG=data.p_WG - np.column_stack([np.zeros((n, 2)), 1e-7 * data.p[:, 0] + 0.01 * data.i[:, 1]])
    )
    order = np.full(n, -1)
    usable = np.flatnonzero(np.arange(n) % 10 != 9)
    order[usable] = np.random.default_rng(seed).permutation(len(usable))
    links = {"L_1": 0.15, "L_2": 0.225, "L_3": 0.225, "elbow": "UP"}
    arm = {"parameters": replace(TRAINING, fmu=cached("VslArm", 3)).parameters()}
    return Measured(data, order, {"arm": arm, "links": links, "seed": seed, "walk": False})


def shipped() -> VslModel:
    return read_model(shipped_file("cubic"))
