"""The command `handover vsl-train`: learned kinematics of the arm with variable-stiffness links."""

import math
import os
import sys
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import click
import numpy as np

from handover.controllers.vsl.fit_network import EPOCHS, NoPyTorch, torch_or_refusal
from handover.controllers.vsl.hybrid_kinematics import LENGTHS, Params
from handover.controllers.vsl.kinematics import Elbow, Unreachable, VslKinematics
from handover.controllers.vsl.learned_model import ForwardInput, Learned, VslModel
from handover.controllers.vsl.model_text import InvalidModel, model_text, read_model
from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import CosimError, UnitFailure, nearest
from handover.fmus.binaries import NotCompiled
from handover.fmus.build import cached
from handover.fmus.compile import CompilationError, UnknownPlatform
from handover.scenarios.cli.options import PATH, SEED, WholeNumber
from handover.scenarios.robots.vsl.data_file import InvalidData, read_data, write_data
from handover.scenarios.robots.vsl.learning_curve import curve_table, draw_curve, learning_curve
from handover.scenarios.robots.vsl.residuals import Errors
from handover.scenarios.robots.vsl.training import MIN_POINTS, NothingToLearn, Progress, VslTraining
from handover.scenarios.robots.vsl.training_data import LEAST_SPAN, RADII, Measured, describe_arm, measured_reach
from handover.scenarios.runs.execution.errors import UsageError, require_extra
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.progress import progress_bar
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    check_place,
    make_folder_of,
    replacing,
    write_whole,
)

_MIN_ADAPTATION = 20
"""Number of points below which the eleven weights of an adaptation are not worth fitting (assumed)."""

_NOT_OF_THE_ARM = {
    "links": "kinematics are learned of an arm of two links",
    "load_steps": "loads are those of the points, which are drawn; they would have no effect",
    "motion": "each point is measured when the arm has settled, which an arm in equilibrium does at once",
}
"""Parameters of `VslArm` that do not make an arm that differs, by name, and why not."""

_ELBOW = click.Choice([e.name.lower() for e in Elbow], case_sensitive=False)
_LEARNED = click.Choice([e.name.lower() for e in Learned], case_sensitive=False)
_FORWARD = click.Choice([e.value for e in ForwardInput], case_sensitive=False)


class _ArmFailed(click.ClickException):
    """The arm failed while it was measured; reported in one line."""

    exit_code = 3


@click.command("vsl-train", context_settings={"show_default": True})
@click.option(
    "--points",
    type=WholeNumber(min=_MIN_ADAPTATION, max=1_000_000),
    default=1500,
    help="Points to measure; without --adapt at least 400.",
)
@click.option(
    "--walk", is_flag=True, help="From point to point vary pressures, angles or load alone, as the paper does."
)
@click.option(
    "--seed",
    type=SEED,
    help="Seed of all random numbers [default: 0; with --adapt the next after that of the model's points].",
)
@click.option("--elbow", type=_ELBOW, default="up", help="Which way the elbow points.")
@click.option("--plant", type=PATH, help="FMU of the arm [default: VslArm, built from its sources].")
@click.option(
    "--arm",
    multiple=True,
    metavar="NAME=VALUE",
    help="Parameter of the arm, as of one that differs; lengths of links are the kinematics', too, but with --adapt.",
)
@click.option("--learned", type=_LEARNED, default="cubic", help="What corrects rigid kinematics.")
@click.option(
    "--forward-input", type=_FORWARD, default="q", help="What eq. (10) takes: angles, or X = f(q) as printed."
)
@click.option(
    "--friction-compensation", is_flag=True, help="Learn the friction of the gears by the direction of motion, too."
)
@click.option("--epochs", type=WholeNumber(min=1, max=100_000), default=EPOCHS, help="Passes of a published network.")
@click.option("--data", type=PATH, help="Train from the points of this Parquet file in place of measuring.")
@click.option("--save-data", type=PATH, help="Parquet file for the measured points.")
@click.option("--curve", type=PATH, help="PNG file for the errors by number of points; an SVG beside it; and a table.")
@click.option("--adapt", type=PATH, help="Adapt this model to an arm that differs, by few points.")
@click.option(
    "--out", type=PATH, default=Path("vsl_model.json"), help="File for the model; one of that name is replaced."
)
@click.pass_context
def vsl_train(context: click.Context, **given: Any) -> None:
    """Train the kinematics of the arm with variable-stiffness links on the arm's own FMU.

    Measures points at random pressures, joint angles and loads, fits what rigid kinematics leave, and prints the errors
    of points that were set aside. The model is a parameter of HybridKinematics: `-p model=FILE` of vsl_hybrid, with
    -p learned and -p friction_compensation as it was trained.

    The published network is trained by PyTorch, of the extra `train`.

    Ctrl-C aborts; each file is written at the end, whole or not at all.
    """
    typed = {name for name in given if context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT}
    o = _Options(**given)
    with Interruption() as interruption, _one_line_errors(interruption), _one_thread():
        o.check(typed)
        if o.curve:
            require_extra("reports", "--curve")
        with progress_bar(sys.stderr) as progress:
            lines = _adapt(o, progress) if o.adapt else _train(o, progress)
    for line in lines:
        click.echo(line)
    click.echo(str(o.out))


@dataclass(frozen=True, kw_only=True)
class _Options:
    """What was typed."""

    points: int
    walk: bool
    seed: int | None
    elbow: str
    plant: Path | None
    arm: Sequence[str]
    learned: str
    forward_input: str
    friction_compensation: bool
    epochs: int
    data: Path | None
    save_data: Path | None
    curve: Path | None
    adapt: Path | None
    out: Path

    def check(self, typed: set[str]) -> None:
        """Raise UsageError for files that could not be written, and for options that contradict each other."""
        _check_file("--out", self.out, ".json")
        if self.save_data:
            _check_file("--save-data", self.save_data, ".parquet")
        if self.curve:
            _check_file("--curve", self.curve, ".png")
        if self.adapt and (
            idle := typed & {"learned", "forward_input", "friction_compensation", "epochs", "curve", "elbow"}
        ):
            raise UsageError(f"{_names(idle)}: with --adapt it is the model's")
        if self.data and (idle := typed & {"points", "walk", "seed", "save_data"}):
            raise UsageError(f"{_names(idle)}: with --data it is the file's")
        if self.adapt is None and self.data is None and self.points < MIN_POINTS:
            raise UsageError(f"--points {self.points}: without --adapt at least {MIN_POINTS}")
        kind = Learned[self.learned.upper()]
        if "epochs" in typed and kind is not Learned.PUBLISHED:
            raise UsageError("--epochs: of the published network alone")
        if kind is Learned.PHYSICS and self.forward_input != "q":
            raise UsageError("--forward-input X: the beam of --learned physics begins with the joints' angles")
        if kind is Learned.PUBLISHED and self.adapt is None:
            torch_or_refusal()

    def training(self, kinematics: VslKinematics | None = None, seed: int = 0) -> VslTraining:
        """Return the training on the arm's FMU; the seed is for what is drawn where none is given.

        Without kinematics, rigid links are as long as the arm's own.
        """
        fmu = self.plant or _built()
        if kinematics is None:
            kinematics = _rigid_links(fmu, _arm_values(fmu, self.arm), Elbow[self.elbow.upper()])
        return VslTraining(
            fmu=fmu,
            kinematics=kinematics,
            points=self.points,
            seed=seed if self.seed is None else self.seed,
            learned=Learned[self.learned.upper()],
            forward_input=ForwardInput(self.forward_input),
            friction_compensation=self.friction_compensation,
            walk=self.walk,
            arm=_arm_values(fmu, self.arm),
            epochs=self.epochs,
        )

    def measured(self, training: VslTraining, progress: Progress) -> Measured:
        """Return points from the file, or as the arm measures them, which are then saved if wanted."""
        if self.data:
            parameters = None if self.adapt else training.parameters()
            measured = read_data(self.data, training.kinematics, parameters)
            try:
                training.check(measured)
            except NothingToLearn as e:
                raise InvalidData(self.data, e.fault) from e
            return measured
        return training.measure(progress)

    def check_number(self, measured: Measured, least: int, purpose: str) -> None:
        """Raise UsageError where fewer points than the least number are usable."""
        if measured.usable < least:
            of = f"--data {self.data}: " if self.data else ""
            raise UsageError(f"{of}{measured.usable} points with a tip within reach are too few {purpose}: {least}")

    def save(self, measured: Measured, model: VslModel) -> None:
        """Write what is to be written of points and model."""
        if self.save_data:
            try:
                make_folder_of(self.save_data)
                with replacing(self.save_data) as unfinished:
                    write_data(unfinished, measured)
            except OSError as e:
                raise UsageError(f"--save-data {self.save_data}: {e.strerror or e}") from e
        make_folder_of(self.out)
        write_whole(self.out, model_text(model))


def _train(o: _Options, progress: Progress) -> list[str]:
    """Train, write, and return what is to be printed."""
    training = o.training()
    measured = o.measured(training, progress)
    o.check_number(measured, MIN_POINTS // 2, "to train on")
    model, errors = training.learn(measured, progress)
    lines = list(_summary(model, errors))
    points = learning_curve(training, measured, progress) if o.curve else []
    o.save(measured, model)
    if o.curve:
        try:
            make_folder_of(o.curve)
            draw_curve(points, o.curve)
        except OSError as e:
            raise UsageError(f"--curve {o.curve}: {e.strerror or e}; the model is written: {o.out}") from e
        lines += [*curve_table(points), str(o.curve)]
    return lines


def _adapt(o: _Options, progress: Progress) -> list[str]:
    """Adapt a model, write, and return what is to be printed."""
    assert o.adapt is not None
    base = read_model(o.adapt)
    training = o.training(base.kinematics, _seed_of_points(base) + 1).like(base)
    measured = o.measured(training, progress)
    o.check_number(measured, _MIN_ADAPTATION, "to adapt to")
    model, before, errors = training.adapt(base, measured)
    o.save(measured, model)
    return [
        f"{len(measured.points)} points measured; errors of the adapted model are of points that it did not see",
        f"{'mean error, mm':44}{'model-based':>12}{'before':>9}{'adapted':>9}",
        *(
            f"{heading:44}{rigid * 1000:12.2f}{was * 1000:9.2f}{now * 1000:9.2f}"
            for heading, rigid, was, now in (
                (_FORWARD_ROW, errors.forward_model_based, before.forward_hybrid, errors.forward_hybrid),
                (_INVERSE_ROW, errors.inverse_model_based, before.inverse_hybrid, errors.inverse_hybrid),
            )
        ),
    ]


def _seed_of_points(model: VslModel) -> int:
    """Return the seed of the points that a model, or what it was adapted from, was trained on: 0 if that is unknown.

    Points of that seed would be the same again, so that an adaptation would be tested on what the model has seen.
    """
    provenance = model.provenance
    while isinstance(base := provenance.get("adapted_from"), dict):
        provenance = cast("dict[str, Any]", base)
    seed = provenance.get("seed")
    return seed if isinstance(seed, int) else 0


_FORWARD_ROW, _INVERSE_ROW = "forward: tip from the encoders' angles", "inverse: command for a measured tip"


def _summary(model: VslModel, errors: Errors) -> Generator[str, None, None]:
    counts = model.provenance["points"]
    chosen = "to choose by" if model.kind is not Learned.CUBIC else "to choose the penalties by"
    yield (
        f"{counts['measured']} points measured; {counts['training']} to train on, {counts['validation']} {chosen}, "
        f"{counts['test']} to test"
    )
    if any(model.friction):
        yield f"currents by friction of joints 2 and 3: {model.friction[0]:.4f}, {model.friction[1]:.4f} A"
    yield f"{'mean error of the test points, mm':44}{'model-based':>12}{'hybrid':>9}{'ratio':>8}"
    rows = [
        (_FORWARD_ROW, errors.forward_model_based, errors.forward_hybrid),
        (_INVERSE_ROW, errors.inverse_model_based, errors.inverse_hybrid),
    ]
    if errors.forward_other_input is not None:
        other = "X = f(q)" if model.forward_input is ForwardInput.Q else "q"
        this = "q" if model.forward_input is ForwardInput.Q else "X = f(q)"
        rows.insert(1, (f"  from {other} in place of {this}", errors.forward_model_based, errors.forward_other_input))
    for heading, rigid, hybrid in rows:
        yield f"{heading:44}{rigid * 1000:12.2f}{hybrid * 1000:9.2f}{rigid / hybrid:8.1f}"


def _arm_values(fmu: Path, given: Sequence[str]) -> dict[str, Any]:
    """Return the arm's parameters from their texts.

    Raises:
        UsageError: the arm has no such parameter, or a value is out of its range.
    """
    values: dict[str, Any] = {}
    if not given:
        return values
    parameters = describe_arm(fmu).parameters
    for text in given:
        name, equals, value = text.partition("=")
        if not equals:
            raise UsageError(f"--arm {text!r} is not of the form NAME=VALUE")
        if name in _NOT_OF_THE_ARM:
            raise UsageError(f"--arm {text}: {_NOT_OF_THE_ARM[name]}")
        if name not in parameters:
            raise UsageError(f"--arm {text}: the arm has no parameter {name!r}; {nearest(name, parameters)}")
        port = parameters[name]
        values[name] = value
        if port.kind in (Kind.REAL, Kind.INTEGER):
            try:
                numbers = [float(part) for part in (value.split(",") if port.shape else [value])]
            except ValueError as e:
                what = (
                    f"is not {math.prod(port.shape)} numbers with commas between" if port.shape else "is not a number"
                )
                raise UsageError(f"--arm {text}: {value!r} {what}") from e
            whole = port.kind is Kind.INTEGER and numbers[0].is_integer()
            values[name] = np.array(numbers) if port.shape else int(numbers[0]) if whole else numbers[0]
        if fault := fault_of(port, values[name]):
            raise UsageError(f"--arm {text}: {fault}")
    return values


def _rigid_links(fmu: Path, arm: Mapping[str, Any], elbow: Elbow) -> VslKinematics:
    """Return rigid links that are as long as the arm's; lengths that it does not tell are those of HybridKinematics.

    Raises:
        UsageError: they do not reach over the workspace in which points are measured.
    """
    usual, declared = Params(), describe_arm(fmu).parameters
    starts = {name: declared[name].start for name in LENGTHS if name in declared}
    lengths = [float(arm.get(name) or starts.get(name) or getattr(usual, name)) for name in LENGTHS]
    L_1, L_2, L_3 = lengths
    kinematics = VslKinematics(L_1, L_2, L_3, elbow)
    low, high = measured_reach(kinematics)
    if high - low < LEAST_SPAN:
        raise UsageError(
            f"links of {L_2:g} and {L_3:g} m: points are measured from {RADII[0]:g} to {RADII[1]:g} m "
            f"from the axis of joint 1, where these reach no span of {LEAST_SPAN:g} m; take longer or more equal ones"
        )
    return kinematics


def _names(options: set[str]) -> str:
    return ", ".join(f"--{name.replace('_', '-')}" for name in sorted(options))


@contextmanager
def _one_thread() -> Generator[None, None, None]:
    """Keep linear algebra on one thread: of matrices this small, several take longer, and round otherwise."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        yield


def _built() -> Path:
    try:
        return cached("VslArm", 3)
    except OSError as e:
        raise UsageError(f"the folder of built units cannot be used: {e}; HANDOVER_CACHE names another") from e


def _check_file(option: str, out: Path, suffix: str) -> None:
    longest = 240  # of the 255 bytes of a file's name; the unfinished file's name is longer
    if out.suffix != suffix:
        raise UsageError(f"{option} {out}: a name that ends in {suffix}")
    if len(os.fsencode(out.name)) > longest:
        raise UsageError(f"{option} {out}: the name is longer than {longest} bytes")
    if out.is_dir():
        raise UsageError(f"{option} {out}: there is a folder of that name")
    try:
        check_place(out.parent)
    except InvalidRunFolder as e:
        raise UsageError(f"{option} {out}: {e.fault}") from e


@contextmanager
def _one_line_errors(interruption: Interruption) -> Generator[None, None, None]:
    try:
        yield
    except UnitFailure as e:
        interruption.check()  # a unit may have taken Ctrl-C for a failure of its own
        raise _ArmFailed(e.cause) from e
    except Unreachable as e:
        raise UsageError(f"a measured tip is where no rigid arm could be: {e}") from e
    except (CosimError, InvalidData, InvalidModel, NoPyTorch, NotCompiled, NothingToLearn, UnknownPlatform) as e:
        interruption.check()
        raise UsageError(str(e)) from e
    except CompilationError as e:
        raise UsageError(str(e).replace("\n", " ", 1)) from e
