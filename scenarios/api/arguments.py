"""What a Python call gives, as the texts, exact times and options that the command gives; and errors for Python."""

import enum
import math
import os
import re
from collections.abc import Callable, Generator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import fields, replace
from difflib import get_close_matches
from fractions import Fraction
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, cast

import numpy as np

from handover.cosim.exceptions import CosimError, UnitFailure, nearest, visible
from handover.cosim.fmu.file.default_experiment import exact_seconds
from handover.cosim.record.formats import RECORD_FORMATS
from handover.cosim.stepping.options import CALL_LIMIT, Algorithm, MasterOptions
from handover.cosim.typed_data import GREATEST_SEED, is_exact_time
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.runs.execution.errors import (
    ClusterLost,
    RunNotWritten,
    UnitLost,
    UsageError,
    WorkersLost,
    one_line_errors,
)
from handover.scenarios.runs.execution.fmu_run import is_fmu
from handover.scenarios.runs.execution.selection import find_scenario
from handover.scenarios.runs.execution.ssp_run import is_ssp

Seconds = float | Fraction
"""A time in seconds; a number with a point is taken as it is written, 0.1 as one tenth."""


class InvalidInput(ValueError):
    """What is asked for cannot be run: the message has all faults, with what would be right.

    Nothing has started, and nothing is written.
    """


@contextmanager
def errors_for_python(
    named: Mapping[str, Any] | None = None,
    function: Callable[..., Any] | None = None,
    elsewhere: Mapping[str, str] | None = None,
) -> Generator[None, None, None]:
    """Raise what is wrong with a call as InvalidInput, and other failures as they are.

    Args:
        named: keywords of the call that should be parameters.
        function: what was called, for whose arguments unknown ones of them may stand.
        elsewhere: arguments of other functions that it has not, with what is right instead.

    Raises:
        InvalidInput: see there.
        UnitFailure: a unit failed before anything ran.
        RecordNotWritten: the disk is full.
        ClusterLost: a campaign's workers were lost.
    """
    try:
        with one_line_errors():
            yield
    except UsageError as e:
        unknown: Sequence[str] = e.__cause__.unknown if isinstance(e.__cause__, InvalidParameter) else ()
        meant = (
            []
            if function is None
            else _meant_arguments([n for n in unknown if n in (named or ())], function, elsewhere or {})
        )
        raise InvalidInput(visible("; ".join([_with_arguments(e.message), *meant]))) from e.__cause__
    except (UnitLost, RunNotWritten, WorkersLost) as e:
        cause = e.__cause__
        raise cause if isinstance(cause, (CosimError, UnitFailure, ClusterLost)) else e from None


_LIKE_AN_ARGUMENT = 0.7
"""How like an argument's name, of 1, an unknown keyword is that is taken for a misspelled one."""


def _meant_arguments(unknown: Sequence[str], function: Callable[..., Any], elsewhere: Mapping[str, str]) -> list[str]:
    """Return a hint for each keyword that is not a parameter, and is an argument elsewhere or like one's name."""
    own = {p.name: p.name for p in signature(function).parameters.values() if p.kind is Parameter.KEYWORD_ONLY}
    of_master = {f.name: f"options=handover.MasterOptions({f.name}=...)" for f in fields(MasterOptions)}
    arguments = {**(of_master if "options" in own else {}), **own}
    near = {n: get_close_matches(n, arguments, 1, _LIKE_AN_ARGUMENT) for n in unknown if n not in elsewhere}
    return [f"{n}: {elsewhere[n]}" for n in unknown if n in elsewhere] + [
        f"as an argument, {n!r} is spelt {arguments[names[0]]}" for n, names in near.items() if names
    ]


_ARGUMENTS = {
    "--unit": "units",
    "--input": "inputs",
    "--format": "formats",
    "--signal": "signals",
    "--metric": "metrics",
    "-p": "parameters",
    "--inputs-from": "inputs_from",
    "--repeat": "seeds",
    **{f"--{name}": name for name in ("algorithm", "checkpoint", "isolate", "out", "record", "scheduler")},
    **{f"--{name}": name for name in ("seed", "seeds", "start", "step", "stop", "workers")},
}
"""The arguments of Python's functions by the options of the command, where messages name these."""

_OPTION = re.compile(r"(?<![\w/-])(-p|--[a-z][a-z-]*)(?![\w-])(?: (?=[\w.]+=)| (-?\d[\d.e+-]*|[A-Z]+\b))?")


def _with_arguments(message: str) -> str:
    """Return a message with arguments of Python in place of options: `stop=10` for `--stop 10`.

    Commands between backticks, which are to be typed in a terminal, stay.
    """
    parts = message.split("`")
    return "`".join(p if p.startswith("handover ") else _OPTION.sub(_argument, p) for p in parts)


def _argument(found: re.Match[str]) -> str:
    name = _ARGUMENTS.get(found[1])
    if name is None:
        return found[0]
    if found[1] == "-p" and found[0].endswith(" "):
        return ""  # of `-p imu=none` the setting itself is the argument
    return f"{name}={found[2]}" if found[2] else f"{name}{' ' if found[0].endswith(' ') else ''}"


def text_of_value(value: Any) -> str:
    """Return a parameter's value as the command takes it: `reflex`, `true`, `0.1,0.2`."""
    if isinstance(value, enum.Enum):
        return value.name.lower()
    plain: Any = value.tolist() if hasattr(value, "tolist") else value  # of numpy's arrays and numbers
    if isinstance(plain, bool):
        return str(plain).lower()
    if isinstance(plain, (list, tuple)):
        return ",".join(text_of_value(entry) for entry in cast(Sequence[Any], plain))
    return repr(float(plain)) if isinstance(plain, (float, Fraction)) else str(plain)


def texts_of(values: Mapping[str, Any]) -> list[str]:
    """Return parameters as texts `NAME=VALUE`."""
    return [f"{name}={text_of_value(value)}" for name, value in values.items()]


def single_texts(subject: object, values: Mapping[str, Any]) -> list[str]:
    """Return parameters of one run as texts `NAME=VALUE`.

    Raises:
        InvalidInput: a list is given for a scenario's parameter that is not an array.
        UsageError: there is no such scenario.
    """
    if is_scenario(subject):
        experiment = find_scenario(subject) if isinstance(subject, str) else cast(type[Experiment[Any]], subject)
        scalars = {v.name for v in experiment.parameters() if not v.shape}
        for name, value in values.items():
            if name in scalars and (isinstance(value, (list, tuple)) or getattr(value, "ndim", 0)):
                raise InvalidInput(f"{name} = {value!r}: a run has one value; handover.sweep varies lists of them")
    return texts_of(values)


def is_scenario(subject: object) -> bool:
    """Return whether a subject names or is a scenario, not a file or a system."""
    if isinstance(subject, str):
        return not is_ssp(subject) and not is_fmu(subject)
    return isinstance(subject, type) and issubclass(subject, Experiment)


def of_type(name: str, value: Any, types: type | tuple[type, ...], right: str) -> Any:
    """Return a value that is of one of some types.

    Raises:
        InvalidInput: it is of another one.
    """
    if not isinstance(value, types):
        raise InvalidInput(f"{name} = {value!r:.60}: expected {right}")
    return value


def _number_of(seconds: Any) -> float:
    """Return a number of seconds; NaN for what is none, or is beyond all numbers."""
    try:
        return math.nan if isinstance(seconds, (bool, str)) else float(seconds)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def path_of(name: str, value: Any) -> Path:
    """Return the path of a file or a folder.

    Raises:
        InvalidInput: it is neither a text nor a path, is empty, or has a zero byte, which no file system takes.
    """
    right = "a path, as a text or a Path"
    if value == "" or "\0" in str(value):
        raise InvalidInput(f"{name} = {value!r:.60}: expected {right}")
    return Path(of_type(name, value, (str, os.PathLike), right))


def path_or_none(name: str, value: Any) -> Path | None:
    """Return a path that may be left open, see `path_of`; None for None."""
    return None if value is None else path_of(name, value)


def several_texts(name: str, value: Any) -> tuple[str, ...]:
    """Return one text, or several.

    Raises:
        InvalidInput: it is none, nor a list of some.
    """
    right = "a text, or a list of texts"
    given = (value,) if isinstance(value, str) else of_type(name, value, (Sequence, Set), right)
    return tuple(of_type(name, text, str, right) for text in given)


def merged(parameters: Mapping[str, Any] | None, named: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a call: those by keyword, and those of its mapping.

    Raises:
        InvalidInput: some are given both ways, or it is not a mapping.
    """
    given = _mapping("parameters", parameters, "{'servo.gain': 0.5}")
    if "unit" in named:
        raise InvalidInput("unit: what takes the place of units is given as units={'servo': 'my_servo:MyServo'}")
    if both := [name for name in named if name in given]:
        raise InvalidInput(f"{', '.join(both)}: given by keyword and in parameters={{...}}; give one of them")
    return {**given, **named}


def unit_texts(units: Mapping[str, Path | str | Sequence[Path | str]] | None) -> list[str]:
    """Return replacements of units as texts `NAME=FILE`, several as `NAME=A,B`.

    Raises:
        InvalidInput: it is not a mapping.
    """
    given = _mapping("units", units, "{'servo': 'my_servo:MyServo'}")
    return [f"{name}={text_of_value(files)}" for name, files in given.items()]


def _mapping(name: str, value: Any, such_as: str) -> Mapping[str, Any]:
    return {} if value is None else of_type(name, value, Mapping, f"a mapping such as {such_as}")


def positive_seconds(name: str, seconds: Seconds) -> Fraction:
    """Return a time in seconds, which must be given, exactly.

    Raises:
        InvalidInput: it is not a finite number above 0.
    """
    if not 0 < _number_of(seconds) < math.inf:
        raise InvalidInput(f"{name} = {seconds!r:.60}: expected a finite number of seconds above 0")
    return _kept(name, seconds)


def _kept(name: str, seconds: Seconds) -> Fraction:
    """Return a finite number of seconds exactly, if a run's folder keeps it."""
    exactly = seconds if isinstance(seconds, Fraction) else exact_seconds(float(seconds))
    if not is_exact_time(exactly):
        limits = "expected a number of seconds below 1e308, and not finer than 1e-307"
        raise InvalidInput(f"{name} = {float(exactly):g}: {limits}")
    return exactly


def exact(name: str, seconds: Seconds | None) -> Fraction | None:
    """Return a time that may be left open, exactly, likewise; None for None."""
    return None if seconds is None else positive_seconds(name, seconds)


def exact_time(name: str, seconds: Seconds | None) -> Fraction | None:
    """Return a time that may be 0, negative, or left open, exactly; None for None.

    Raises:
        InvalidInput: it is not a finite number.
    """
    if seconds is None:
        return None
    if not math.isfinite(_number_of(seconds)):
        raise InvalidInput(f"{name} = {seconds!r:.60}: expected a finite number of seconds")
    return _kept(name, seconds)


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """Return a whole number, such as a seed.

    Raises:
        InvalidInput: it is none, less than `least`, or beyond 64 bits.
    """
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.bool_))
    if not is_whole or not least <= value <= GREATEST_SEED:
        raise InvalidInput(f"{name} = {value!r:.60}: expected a whole number from {least} to {GREATEST_SEED}")
    return int(cast(Any, value))


def flag(name: str, value: Any) -> bool:
    """Return a yes or no; a text such as "no" would count as yes.

    Raises:
        InvalidInput: it is neither.
    """
    return bool(of_type(name, value, (bool, np.bool_), "True or False"))


def formats_of(formats: Sequence[str]) -> tuple[str, ...]:
    """Return formats of a record, each once.

    Raises:
        InvalidInput: one is unknown.
    """
    given = several_texts("formats", formats)
    if wrong := [f for f in given if f not in RECORD_FORMATS]:
        raise InvalidInput(f"formats: {'; '.join(f'{f!r}: {nearest(str(f), RECORD_FORMATS)}' for f in wrong)}")
    return tuple(dict.fromkeys(given))


def master_options(
    options: MasterOptions | None, algorithm: str | Algorithm | None, isolate: str | Sequence[str] = ()
) -> MasterOptions:
    """Return the master's options: the given ones or the command's defaults, with algorithm and isolation set.

    An argument takes the place of an option that is at its default.

    Raises:
        InvalidInput: there is no such algorithm, one is of another type, or options say otherwise than an argument.
        InvalidOptions: see `MasterOptions`.
    """
    default = MasterOptions(call_limit=CALL_LIMIT) if options is None else options
    chosen: MasterOptions = of_type("options", default, MasterOptions, "handover.MasterOptions(...)")
    if isinstance(algorithm, str):
        known = {a.value: a for a in Algorithm}
        if algorithm not in known:
            raise InvalidInput(f"no algorithm {algorithm!r}; {nearest(algorithm, known)}")
        algorithm = known[algorithm]
    names = tuple(dict.fromkeys(several_texts("isolate", isolate)))
    given: dict[str, Any] = {
        **({} if algorithm is None else {"algorithm": algorithm}),
        **({"isolated": names} if names and set(names) != set(chosen.isolated) else {}),
    }
    for name, value in given.items():
        if getattr(chosen, name) not in (getattr(MasterOptions(), name), value):
            raise InvalidInput(f"{name!r} is given in options, too, and otherwise; give one of them")
    return replace(chosen, **given)
