"""Makes an FMU's reference experiment: a stimulus, and what its outputs were as it was played to the FMU itself.

The default stimulus leaves everything at its start value for ten steps. Then every real input that has a unit, or a
range with both ends, moves: entries in turn by a step and by a ramp of twenty steps, by a tenth of the range or,
without one, by a hundredth of the start value or of one unit. Numbers without unit or range stay: they are quaternions
and rotation matrices more often than not.

The tolerance of the result is measured. Other platforms round otherwise, so the stimulus is played once more with every
real input 1e-13 of its value smaller, which is some hundred times the rounding of one operation, or that much larger
where its range ends. A Float32 does not hold as little, so 1e-7 is taken of it, which is its last place. Of 0 there is
no share, and in a system that feeds the unit a 0 is a sum of values as large as the input has otherwise, and as exact
as these: it is off by 1e-13 of the largest magnitude that the input has in the stimulus, in any entry, and a Float32,
too, as it holds that near 0; of an input that is 0 throughout, of its nominal value or, without one, of its range, else
of one unit. Ten times the greatest difference that all this makes is allowed, relative to the variable's largest value,
but no less than 1e-9; for outputs that rest at 0, ten times theirs absolutely, from 1e-12 to 1e-9. Of Float32 outputs
2**-23 is always allowed (`handover.cosim.experiments.reference_experiment`), so differences within it do not count.

A unit may switch at 0: friction has the sign of a speed. If inputs that are off 0 change outputs by more than can be
allowed, they stay at 0, which all machines read alike, and only the others are off. Parameters stay as they are. Where
no input could be off within its range, nothing is measured, and the tolerance is the least one. The text in the FMU
says what was done. With their default stimuli the catalog's units need no more: their largest difference is 2.9e-11, of
TendonArm's tension; VslArm and HybridKinematics switch at 0. numpy and OpenBLAS without AVX2 and AVX-512 put that
tension off by 1e-11, and the outputs of 15 other units by at most 2e-10, which is PoseController's `slowest_decay`: a
number made of parameters alone, which inputs do not move.
"""

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.experiments.experiment_run import (
    communication_points,
    result_columns,
    run_experiment,
    stimulus_columns,
)
from handover.cosim.experiments.reference_experiment import (
    ABSOLUTE,
    Difference,
    Setup,
    differences,
)
from handover.cosim.experiments.signal_table import (
    Column,
    InvalidTable,
    SignalTable,
    has_columns,
    read_header,
    read_table,
    unknown_columns,
    write_table,
)
from handover.cosim.files import read_regular, scratch_folder
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.fmu.start_values import entries_of
from handover.cosim.probe.finding import Finding, Level
from handover.fmus.compile import host_platform
from handover.fmus.contents.related_files import CannotRecordExperiment, NothingToCompare

_STEPS, _AT_REST, _RAMP = 50, 10, 20
_SHARE_OF_RANGE, _SHARE_OF_VALUE = 0.1, 0.01
_PERTURBATION, _FLOAT32_PERTURBATION = 1e-13, 1e-7
_MARGIN, _LEAST, _MOST = 10.0, 1e-9, 1e-2
_MOST_ABSOLUTE = 1e-9
_TIMEOUT = 600.0  # s, of the first two runs together, and of each later one


@dataclass(frozen=True)
class Tolerance:
    """How closely a result can be met, as it was measured.

    Attributes:
        spread: the difference between the two runs, of the output that differed most; None if none differed by more
            than is allowed anyway.
        absolute: tolerance in an output's unit.
        is_measured: whether the unit got other inputs in the second run.
        at_zero: what inputs that were off 0 changed, where they stay at 0 for that reason.
    """

    spread: Difference | None
    absolute: float
    is_measured: bool
    at_zero: Difference | None = None

    @property
    def relative(self) -> float:
        """Tolerance relative to an output's largest value."""
        return relative_tolerance(self.spread)

    @property
    def is_useful(self) -> bool:
        """Whether a comparison by it proves anything."""
        return self.spread is None or self.spread.share * _MARGIN <= _MOST

    @property
    def text(self) -> str:
        """What users should know of how it was measured."""
        at_zero = (
            "those at 0 were off it by 1e-13 of the largest value that they have in another row or entry, else of "
            "their nominal value or range, else of one unit"
        )
        if self.at_zero is not None:
            at_zero = f"those at 0 stayed there, as off it they change {self.at_zero.name} {_size(self.at_zero)}"
        if not self.is_measured:
            why = "there is no real input that could be off within its range"
            if self.at_zero is not None:
                why = f"of the real inputs all that could be off are 0, and {at_zero}"
            return f"It is not measured: {why}. Where rounding grows within the unit, it may be too little elsewhere."
        resting = f"no output by more than {self.absolute:g} in its unit, or the last place of a Float32"
        change = f"{resting}, so that {_LEAST:g} is enough"
        if self.spread is not None:
            most = f"the outputs by at most {self.spread.share:.2g} of its largest value ({self.spread.name})"
            change = f"{most}. Ten times that is allowed, and no less than {_LEAST:g}"
        how = f"It is measured: real inputs were off by 1e-13 of their value (of a Float32 by 1e-7), and {at_zero}"
        return f"{how}; parameters stayed. That changed {change}."


@dataclass(frozen=True)
class RecordedExperiment:
    """A stimulus with its result, both as CSV, and how the result was made; `origin` says whose the stimulus is."""

    stimulus: bytes
    result: bytes
    setup: Setup
    origin: str
    tolerance: Tolerance

    def text_lines(self, stimulus: str, result: str) -> list[str]:
        """Return what users should know, for the files of these names."""
        s = self.setup
        allowed = (
            f"Tolerance: {s.relative:g} of the largest value that a variable has in the result (of a Float32 2**-23 at "
            f"least), plus {s.absolute:g} in its unit; what is not a real number is equal. {self.tolerance.text}"
        )
        lines = [
            f"{stimulus} has the inputs, {self.origin}: columns of CSV, time in seconds and entries named as",
            "in FMI 2. An input holds the latest row's value from initialisation on; others hold their start values.",
            f"{result} has the outputs at all communication points, as this FMU gave them on {host_platform()}: every",
            f"{s.step} s and, if the FMU takes steps of any size, where the inputs have a row; without event mode, all",
            "parameters being as in the model description.",
            "",
            *textwrap.wrap(allowed, 110),
            "",
        ]
        if s.left_out:
            lines += [f"Left out, as binary or of more than 1000 entries: {', '.join(s.left_out)}.", ""]
        return [*lines, "`handover check FILE.fmu` plays the stimulus and compares.", ""]


def record_experiment(fmu: Path, step: Fraction, stimulus: Path | None = None) -> RecordedExperiment:
    """Play a stimulus to an FMU, in processes of their own; return it with the first run's outputs.

    There are two runs; a third where inputs off 0 change too much; and one more, of the same inputs, before outputs are
    said to change as inputs round.

    Args:
        fmu: the FMU.
        step: its communication step, in seconds.
        stimulus: a CSV file of inputs over time; None: the default one, see above.

    Raises:
        InvalidTable: the stimulus is not one for this FMU.
        CannotRecordExperiment: there is no library for this machine, no output to compare, a run fails, or rounding
            changes the outputs by so much that a comparison on other machines would prove nothing.
        OSError: the file cannot be read.
    """
    d = describe_fmu(fmu)
    columns, compared = stimulus_columns(d), result_columns(d)
    given = default_stimulus(d, step) if stimulus is None else read_stimulus(stimulus, columns)
    given = given.snapped(given.times[0], step)
    communication_points(given.times, (), step, varies_step=d.capabilities.varies_step)
    if not compared:
        raise NothingToCompare(d.name)
    received = as_received(given, columns)
    shares = perturbed(given, columns, off_zero=False)
    nearby = perturbed(given, columns, off_zero=True)
    with scratch_folder("reference") as scratch:
        folder = scratch / "fmu"
        FmuArchive(fmu).unpack(folder)
        first, second = _played(d, folder, [write_table(t, columns) for t in (given, nearby)], step, scratch)
        one, other = (read_table(content, "result", compared) for content in (first, second))

        def change(near: SignalTable) -> list[Difference]:
            (result,) = _played(d, folder, [write_table(near, columns)], step, scratch)
            return differences(one, read_table(result, "result", compared), compared)

        tolerance = measured(differences(one, other, compared), is_measured=nearby != received)
        if not tolerance.is_useful and shares != nearby:
            tolerance = replace(measured(change(shares), is_measured=shares != received), at_zero=tolerance.spread)
        if tolerance.spread is not None and not tolerance.is_useful:
            unexplained = largest_difference(change(given)) if tolerance.is_measured else tolerance.spread
            raise CannotRecordExperiment(_refusal(d.name, tolerance.spread, unexplained))
    setup = Setup(
        step=step,
        relative=tolerance.relative,
        absolute=tolerance.absolute,
        parameters={p.name: p.start or "" for p in d.parameters.values()},
        left_out=tuple(p.name for p in d.outputs.values() if not has_columns(p)),
    )
    origin = "the default ones of `handover build --prove`" if stimulus is None else "given by the FMU's author"
    return RecordedExperiment(write_table(given, columns), first, setup, origin, tolerance)


def measured(found: Sequence[Difference], *, is_measured: bool) -> Tolerance:
    """Return the tolerance for the differences that perturbed inputs made."""
    resting = max((d.greatest for d in found if d.largest <= ABSOLUTE), default=0.0)
    absolute = ABSOLUTE
    if ABSOLUTE < _MARGIN * resting <= _MOST_ABSOLUTE:
        absolute = _rounded_up(_MARGIN * resting)
    return Tolerance(largest_difference(found, absolute), absolute, is_measured)


def _size(spread: Difference) -> str:
    if math.isinf(spread.share):
        return "it no longer gives the same" if math.isinf(spread.greatest) else f"by {spread.greatest:.2g} from 0"
    return f"by {spread.share:.2g} of its largest value"


def _refusal(unit: str, spread: Difference, unexplained: Difference | None) -> str:
    """Return why there is no reference: what near inputs changed, or what the same inputs changed, if they did."""
    if unexplained is not None:
        return (
            f"{unit}: output {unexplained.name!r} changes from one run to the next {_place(unexplained)}, so that no "
            "result could be met; let the unit depend on its inputs, its parameters and a seed alone"
        )
    return (
        f"{unit}: output {spread.name!r} changes as inputs round {_place(spread)}, so that other machines could not "
        "meet a result; give a shorter or calmer stimulus by --stimulus"
    )


def _place(spread: Difference) -> str:
    return f"({_size(spread)} at t = {spread.at:g} s)"


def largest_difference(found: Iterable[Difference], absolute: float = ABSOLUTE) -> Difference | None:
    """Return the largest difference, relative to its variable, of those above `absolute`; None if there are none.

    Those below are allowed anyway, and those of an output that rests at 0 are infinite relative to it. Likewise those
    in the last place of a Float32.
    """
    beyond = (d for d in found if d.greatest > max(absolute, d.resolution * d.largest))
    return max(beyond, key=lambda d: d.share, default=None)


def relative_tolerance(spread: Difference | None) -> float:
    """Return ten times a difference, rounded up to one digit; no less than `_LEAST`, as where there is none."""
    wanted = _MARGIN * spread.share if spread is not None else 0.0
    return _LEAST if wanted <= _LEAST else _rounded_up(wanted)


def _rounded_up(number: float) -> float:
    """Return a number with one digit, such as 4e-11 for 3.2e-11."""
    digit = 10.0 ** math.floor(math.log10(number))
    return float(f"{math.ceil(number / digit) * digit:.0e}")


def _played(
    d: FmuDescription, folder: Path, stimuli: Sequence[bytes], step: Fraction, scratch: Path
) -> list[bytes]:  # fmt: skip
    """Return the results of stimuli.

    Raises:
        CannotRecordExperiment: a run fails.
    """
    runs = [
        {"stimulus": scratch / f"stimulus-{k}.csv", "result": scratch / f"result-{k}.csv"} for k in range(len(stimuli))
    ]
    for run, stimulus in zip(runs, stimuli, strict=True):
        run["stimulus"].write_bytes(stimulus)
    faults = [f for f in run_experiment(d.path, folder, runs, step, scratch, _TIMEOUT) if f.level is Level.FAULT]
    if faults:
        raise CannotRecordExperiment(f"{d.name} fails as its reference is made: {_with_log(faults[0])}")
    return [run["result"].read_bytes() for run in runs]


def _with_log(finding: Finding) -> str:
    return f"{finding.line}{f' ({finding.log[-1].strip()})' if finding.log else ''}"


def read_stimulus(file: Path, columns: Mapping[str, Column]) -> SignalTable:
    """Return a stimulus from a CSV file.

    Raises:
        InvalidTable: it is not CSV, names what is no input, has values that its inputs cannot have, or has less than 2
            rows or times that do not rise.
        OSError: it cannot be read.
    """
    content, name = read_regular(file), str(file)
    if lacking := unknown_columns(read_header(content, name), columns, "input"):
        raise InvalidTable(name, lacking)
    table = read_table(content, name, columns, in_range=True)
    if len(table.times) < 2:
        raise InvalidTable(name, ["it has one row; expected at least two, as the last row's time is the end"])
    return table


def default_stimulus(d: FmuDescription, step: Fraction) -> SignalTable:
    """Return the default stimulus, see above: a row a step, a column an entry of an input."""
    columns = stimulus_columns(d)
    starts: dict[str, list[Any]] = {
        p.name: [p.start or ""] if p.kind is Kind.STRING else entries_of(p, {}) for p, _ in columns.values()
    }
    moving = [name for name, (port, _) in columns.items() if _moves(port)]
    ramped = set(moving[1::2])
    values = {
        name: _moved(port, starts[port.name][i], ramped=name in ramped) if name in moving
        else [starts[port.name][i]] * (_STEPS + 1)
        for name, (port, i) in columns.items()
    }  # fmt: skip
    return SignalTable([k * step for k in range(_STEPS + 1)], values)


def _moves(port: FmuPort) -> bool:
    has_range = port.minimum is not None and port.maximum is not None
    return port.is_continuous and (has_range or port.unit.symbol != "1")


def _moved(port: FmuPort, start: float, *, ramped: bool) -> list[float]:
    low, high = port.minimum, port.maximum
    by = _SHARE_OF_VALUE * max(1.0, abs(start))
    if low is not None and high is not None:
        by = _SHARE_OF_RANGE * (high - low)
    if high is not None and start + by > high:
        by = -by
    shares = [min(1.0, max(0.0, (k - _AT_REST) / _RAMP)) if ramped else float(k >= _AT_REST) for k in range(_STEPS + 1)]
    return [start + share * by for share in shares]


def as_received(stimulus: SignalTable, columns: Mapping[str, Column]) -> SignalTable:
    """Return a stimulus as the unit gets it: values of Float32 inputs are rounded."""
    rounded = {
        name: [_rounded(columns[name][0], x) for x in values] if columns[name][0].kind is Kind.REAL else values
        for name, values in stimulus.columns.items()
    }
    return replace(stimulus, columns=rounded)


def perturbed(stimulus: SignalTable, columns: Mapping[str, Column], *, off_zero: bool) -> SignalTable:
    """Return a stimulus as the unit gets it, but with real values a little nearer to 0, or farther off within a range.

    With `off_zero` zeros are off 0 by as small a share of their input's magnitude, see above; else they stay.
    """
    received = as_received(stimulus, columns)
    largest: dict[str, float] = {}
    for name, values in received.columns.items():
        port = columns[name][0]
        if port.kind is Kind.REAL:
            largest[port.name] = max(largest.get(port.name, 0.0), *map(abs, values))
    changed: dict[str, Sequence[Any]] = {}
    for name, values in received.columns.items():
        port = columns[name][0]
        if port.kind is Kind.REAL:
            at_zero = _PERTURBATION * (largest[port.name] or _magnitude(port)) if off_zero else 0.0
            values = [_perturbed_value(x, at_zero, port) for x in values]
        changed[name] = values
    return replace(received, columns=changed)


def _magnitude(port: FmuPort) -> float:
    """Return the usual magnitude of an input that is 0 throughout, as far as it is declared."""
    has_range = port.minimum is not None and port.maximum is not None
    ends = (abs(port.minimum or 0.0), abs(port.maximum or 0.0)) if has_range else (0.0,)
    return abs(port.nominal or 0.0) or max(ends) or 1.0


def _perturbed_value(x: float, at_zero: float, port: FmuPort) -> float:
    """Return a value a little nearer to 0, else a little farther off; the value itself if neither is in range."""
    low = -math.inf if port.minimum is None else port.minimum
    high = math.inf if port.maximum is None else port.maximum
    share = _FLOAT32_PERTURBATION if port.width is Width.FLOAT32 else _PERTURBATION
    choices = (x * (1.0 - share), x * (1.0 + share)) if x else (at_zero, -at_zero)
    return next((c for c in (_rounded(port, choice) for choice in choices) if low <= c <= high and c != x), x)


def _rounded(port: FmuPort, x: float) -> float:
    return x if port.width is None else port.width.rounded(x)
