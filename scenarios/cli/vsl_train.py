"""The command `handover vsl-train`: learned kinematics of the arm with variable-stiffness links."""

import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import click

from handover.controllers.vsl.hybrid_kinematics import Params
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.cosim.exceptions import CosimError, UnitFailure
from handover.fmus.binaries import NotCompiled
from handover.fmus.build import cached
from handover.fmus.compile import CompilationError, UnknownPlatform
from handover.scenarios.cli.options import WholeNumber
from handover.scenarios.execution.errors import UsageError
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.progress import progress_bar
from handover.scenarios.vsl.training import MIN_POINTS, Errors, NothingToLearn, VslTraining, file_text

_PATH = click.Path(path_type=Path)

_ELBOW = click.Choice([e.name.lower() for e in Elbow], case_sensitive=False)


class _ArmFailed(click.ClickException):
    """The arm failed while it was measured; reported in one line."""

    exit_code = 3


@click.command("vsl-train", context_settings={"show_default": True})
@click.option("--points", type=WholeNumber(min=MIN_POINTS, max=1_000_000), default=1500, help="Points to measure.")
@click.option("--seed", type=WholeNumber(min=0), default=0, help="Seed of all random numbers.")
@click.option("--elbow", type=_ELBOW, default="up", help="Which way the elbow points.")
@click.option("--plant", type=_PATH, help="FMU of the arm [default: VslArm, built from its sources].")
@click.option(
    "--out", type=_PATH, default=Path("vsl_model.json"), help="File for the model; one of that name is replaced."
)
def vsl_train(points: int, seed: int, elbow: str, plant: Path | None, out: Path) -> None:
    """Train the kinematics of the arm with variable-stiffness links on the arm's own FMU.

    Measures points at random pressures, joint angles and loads, fits what rigid kinematics leave, and prints the errors
    of points that were set aside. The model is a parameter of HybridKinematics: `-p model=FILE` of vsl_hybrid. An --out
    that ends in .py gets the form of controllers/vsl/default_model.py.

    Ctrl-C aborts; the file is written at the end, whole or not at all.
    """
    with Interruption() as interruption, _one_line_errors(interruption):
        _check_file(out)
        arm = Params(elbow=Elbow[elbow.upper()])
        kinematics = VslKinematics(arm.L_1, arm.L_2, arm.L_3, arm.elbow)
        training = VslTraining(fmu=plant or _built(), kinematics=kinematics, points=points, seed=seed)
        with progress_bar(sys.stderr) as progress:
            model, errors = training.train(progress)
        _write(out, file_text(model, out))
    counts = model.provenance["points"]
    click.echo(
        f"{counts['measured']} points measured; {counts['training']} to train on, {counts['validation']} to choose the "
        f"penalties by, {counts['test']} to test"
    )
    for line in _table(errors):
        click.echo(line)
    click.echo(str(out))


def _table(errors: Errors) -> Generator[str, None, None]:
    yield f"{'mean error of the test points, mm':44}{'model-based':>12}{'hybrid':>9}{'ratio':>8}"
    rows = (
        ("forward: tip from the encoders' angles", errors.forward_model_based, errors.forward_hybrid),
        ("inverse: command for a measured tip", errors.inverse_model_based, errors.inverse_hybrid),
    )
    for heading, rigid, hybrid in rows:
        yield f"{heading:44}{rigid * 1000:12.2f}{hybrid * 1000:9.2f}{rigid / hybrid:8.1f}"


def _built() -> Path:
    try:
        return cached("VslArm", 3)
    except OSError as e:
        raise UsageError(f"the folder of built units cannot be used (HANDOVER_CACHE): {e}") from e


def _check_file(out: Path) -> None:
    folder = out.absolute().parent
    longest = 240  # of the 255 bytes of a file's name; the unfinished file's name is longer
    if out.suffix not in (".json", ".py"):
        raise UsageError(f"--out {out}: a name that ends in .json, or in .py for the module form")
    if len(os.fsencode(out.name)) > longest:
        raise UsageError(f"--out {out}: the name is longer than {longest} bytes")
    if out.is_dir():
        raise UsageError(f"--out {out}: there is a folder of that name")
    if not folder.is_dir():
        raise UsageError(f"--out {out}: there is no folder {folder}")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"--out {out}: no permission to write to {folder}")


def _write(out: Path, text: str) -> None:
    """Write a file that appears whole or not at all."""
    try:
        handle, part = tempfile.mkstemp(dir=out.absolute().parent, prefix=f".{out.name}-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
            Path(part).chmod(0o644)
            os.replace(part, out)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise
    except OSError as e:
        raise UsageError(f"--out {out}: {e.strerror}") from e


@contextmanager
def _one_line_errors(interruption: Interruption) -> Generator[None, None, None]:
    try:
        yield
    except UnitFailure as e:
        interruption.check()  # a unit may have taken Ctrl-C for a failure of its own
        raise _ArmFailed(e.cause) from e
    except (CosimError, NotCompiled, NothingToLearn, UnknownPlatform) as e:
        interruption.check()
        raise UsageError(str(e)) from e
    except CompilationError as e:
        raise UsageError(str(e).replace("\n", " ", 1)) from e
