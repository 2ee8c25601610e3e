"""Exceptions of the engine: invalid files, wiring and options, and failing units. Each carries its data.

Messages say what is wrong, where, and what would be valid. The helpers at the top make them one-line and readable: they
suggest the nearest valid name and find in a unit's log the line that gives the cause.
"""

import difflib
import heapq
import re
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

_STATUS = re.compile(r"^\[\w+\] ")
_STATUS_AND_CALL = re.compile(r"^\[\w+\] fmi[23]\w+: ")
_SYNTAX = re.compile(r"(?:SyntaxError|IndentationError|TabError): ")
_LOCATION = re.compile(r'File "(?:.*?/resources/sources/)?([^"]+)", line (\d+)')
_OF_AUTHOR = re.compile(r'File "[^"]*?/resources/(?:sources/)?(?!sources/|handover/)([^"]+)", line (\d+)')
"""A line of code that an FMU contains and that is not this package's."""
_OWN_NAME = re.compile(r"^handover(?:\.\w+)+: ")
"""What was raised, where that is this package's: its message says it better."""

_LIKE, _AS_LIKELY = 0.5, 0.3
"""How like a name, of 1, one that is suggested is at least, and how much less than the one most like it."""

_COMPARED, _MANY = 199, 100
"""Letters of names that are compared, and names that are compared letter by letter."""

_RAISED = re.compile(r'\A[\s\S]*^  File "[^\n]*\n(?:[ \t][^\n]*\n)*(\S[\s\S]*)', re.MULTILINE)
"""A traceback, as far as to what was raised, whose message may have several lines."""


MOST_FAULTS = 20
"""Faults of a list that a message has; for more, valid names are not looked for, either."""


def counted(n: int, one: str, many: str = "") -> str:
    """Return how many there are, such as "1 run" or "3 runs"; `many` is the plural that is no `one` with an s."""
    return f"{n} {one if n == 1 else many or one + 's'}"


def first_faults(faults: Sequence[str]) -> list[str]:
    """Return the first of a list of faults as a message has them, and how many more there are, as the last."""
    more = len(faults) - MOST_FAULTS
    return [*faults[:MOST_FAULTS], f"and {more:,} more"] if more > 0 else list(faults)


def did_you_mean(names: Sequence[str]) -> str:
    """Return "did you mean ...?" with the first of some names, "" without any."""
    return f"did you mean {' or '.join(names[:3])}?" if names else ""


def suggestion(name: object, valid: Iterable[str]) -> str:
    """Return "did you mean ...?" with the valid names that are nearest, "" where none is near.

    Nearest of all are those that end so, `arm.k` of `k`. Of many names those are compared that have most pairs of
    letters in common with it.
    """
    text = str(name)[:_COMPARED]
    names = set(valid)
    likeness = dict.fromkeys((n for n in names if text and n.endswith(f".{text}")), 1.0)
    if len(names) > _MANY:
        pairs = dict.fromkeys(re.escape(text[k : k + 2]) for k in range(len(text) - 1))
        common = re.compile("|".join(pairs)).findall
        names = set(heapq.nlargest(_MANY, names, lambda n: len(common(n[:_COMPARED])) - 0.01 * abs(len(n) - len(text))))
    matcher = difflib.SequenceMatcher(None, "", text)
    for n in names - likeness.keys():
        matcher.set_seq1(n[:_COMPARED])
        likeness[n] = matcher.ratio()
    least = max(_LIKE, max(likeness.values(), default=0.0) - _AS_LIKELY)
    return did_you_mean(sorted((n for n, x in likeness.items() if x >= least), key=lambda n: (-likeness[n], n)))


def hints(names: Iterable[str], valid: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield names with what `nearest` says of each, as long as their faults are of the first of a list; then ""."""
    known = list(valid)
    return ((name, nearest(name, known) if k < MOST_FAULTS else "") for k, name in enumerate(names))


def nearest(name: object, valid: Iterable[str]) -> str:
    """Return the suggestion of valid names; where none is near, all of them."""
    names = set(valid)
    if near := suggestion(name, names):
        return near
    if not names:
        return "there are none"
    return f"valid: {', '.join(heapq.nsmallest(20, names))}{', ...' if len(names) > 20 else ''}"


def log_lines(log: Iterable[str]) -> list[str]:
    """Return the lines of a log that say anything; an entry may have several."""
    return [line for entry in log for line in entry.splitlines() if line.strip()]


def last_line(log: Iterable[str]) -> str:
    """Return the last line of a log that says anything, without status and call.

    Of a traceback that is what was raised, with all of its message, and the last line of the unit's author's that led
    to it; of a syntax error its own.
    """
    log = list(log)
    entry = next((entry for entry in reversed(log) if entry.strip()), "")
    raised = _RAISED.search(entry)
    message = (
        " ".join(raised[1].split()) if raised else _STATUS_AND_CALL.sub("", (log_lines([entry]) or [""])[-1].strip())
    )
    is_syntax = _SYNTAX.match(message)
    places = _LOCATION.findall("\n".join(log)) if is_syntax else _OF_AUTHOR.findall(entry) if raised else []
    place = f" ({places[-1][0]}, line {places[-1][1]})" if places else ""
    return _OWN_NAME.sub("", message) + place


_LONGEST = 4000
"""Characters of a line that is shown."""


def visible(text: str) -> str:
    """Return a text as it may be shown in a terminal: it may come from files of others.

    Characters that could steer the terminal, or turn the direction of letters, are replaced, and lines cut that are
    too long to be read.
    """
    shown = text if text.isprintable() else "".join(map(_visible, text))
    return "\n".join(map(_cut, shown.split("\n")))


def _visible(c: str) -> str:
    return c if c.isprintable() or c == "\n" else " " if c.isspace() else "\N{REPLACEMENT CHARACTER}"


def _cut(line: str) -> str:
    if len(line) <= _LONGEST:
        return line
    return f"{line[:_LONGEST]}... ({len(line) - _LONGEST} characters more)"


def one_line(e: BaseException) -> str:
    """Return an exception's message in one line, as `visible` has it; the name of its type where it has none."""
    return visible(" ".join(str(e).split())) or type(e).__name__


class CosimError(Exception):
    """Base class of the engine's own exceptions."""


_unpacked: dict[Path, Path] = {}
"""Folders in use, with the archives that they were unpacked from."""


@contextmanager
def named_by_archive(folder: Path, archive: Path) -> Generator[None, None, None]:
    """Let messages name an FMU that is unpacked to a folder as `ARCHIVE: MEMBER`."""
    _unpacked[folder] = archive
    try:
        yield
    finally:
        del _unpacked[folder]


def shown_path(path: Path) -> str:
    """Return a path as messages name it, `ARCHIVE: MEMBER` in a folder of `named_by_archive`."""
    for folder, archive in _unpacked.items():
        if path.is_relative_to(folder):
            return f"{archive}: {path.relative_to(folder).as_posix()}"
    return str(path)


class InvalidFmu(CosimError):
    """A file that should be an FMU is missing, damaged, or not one that this machine can run.

    `log` holds what its unit logged, if it got as far as being instantiated.
    """

    def __init__(self, path: Path, fault: str, log: Sequence[str] = ()) -> None:
        super().__init__(f"{shown_path(path)}: {fault}")
        self.path, self.fault, self.log = path, fault, tuple(log)


class InvalidSsp(CosimError):
    """A file is not a valid SSP; `faults` lists everything that is wrong with it, and where."""

    def __init__(self, path: Path, faults: Sequence[str]) -> None:
        super().__init__(f"{path}: {'; '.join(first_faults(faults))}")
        self.path, self.faults = path, tuple(faults)


class NotExportable(CosimError):
    """A system cannot be written as an SSP; `faults` lists everything in it that an SSP cannot express."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__(f"it cannot be written as an SSP: {'; '.join(first_faults(faults))}")
        self.faults = tuple(faults)


class RecordNotWritten(CosimError):
    """A run's record cannot be written, as on a full disk; the rows until then are kept beside it."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"{path} cannot be written: {fault}")
        self.path, self.fault = path, fault


class WiringError(CosimError):
    """A system is wired wrongly; `faults` lists everything that is wrong with it."""

    def __init__(self, faults: Sequence[str]) -> None:
        lines = "".join(f"\n  - {f}" for f in first_faults(faults))
        super().__init__(f"{counted(len(faults), 'fault')} in the system:{lines}")
        self.faults = tuple(faults)


class ScheduleError(CosimError):
    """Units cannot be ordered, or their steps have no common communication step."""


class UnitFailure(CosimError):
    """A unit's call failed; `handover.cosim.fmu.failures` has a subclass for each way in which it can.

    Attributes:
        kind: the way in which it failed, as one word for programs that read a run's summary.
        verdict: the outcome, in the words with which a run's reason begins.
        unit: the instance's name.
        call: the FMI call, or what else was done with the unit.
        t: simulated time in seconds.
        status: what the call returned, or what happened instead.
        log: the unit's last log lines.
    """

    kind: ClassVar[str] = "failure"
    verdict: ClassVar[str] = "a unit failed"

    def __init__(self, unit: str, call: str, t: float, status: str, log: Sequence[str] = ()) -> None:
        self.unit, self.call, self.t, self.status, self.log = unit, call, t, status, tuple(log)
        log_text = "".join(f"\n  {line}" for line in log)
        super().__init__(self.headline + log_text)

    @property
    def headline(self) -> str:
        """One line: unit, call, time, and what happened."""
        return f"{self.unit}: {self.call} at t = {self.t:.6g} s {self.what}"

    @property
    def what(self) -> str:
        """What happened, to be read after the call."""
        return f"answered {self.status}"

    @property
    def message(self) -> str:
        """The last line of the unit's log, or the status where it logged nothing."""
        return last_line(self.log) or self.status

    @property
    def cause(self) -> str:
        """One line: unit, call, time, and the last thing that the unit logged."""
        return f"{self.unit}: {self.call} at t = {self.t:.6g} s: {self.message}"

    def as_data(self) -> dict[str, Any]:
        """Return the failure as a JSON object."""
        return {
            "kind": self.kind,
            "instance": self.unit,
            "call": self.call,
            "time": self.t,
            "status": self.status,
            "log": log_lines(self.log),
        }


class InitializationError(CosimError):
    """A unit did not accept its parameters or did not initialise; nothing has run yet.

    What it logged comes first, as it says what is wrong, then the call that answered the error. `reason` is what else
    is known of it: who has set what the unit did not accept.
    """

    def __init__(self, failure: UnitFailure, reason: str = "") -> None:
        is_status = failure.message == failure.status and failure.status.isalpha()  # one word, such as Discard
        how = f"{failure.call} {failure.what}" if is_status else failure.message
        if not is_status and failure.kind in ("error", "fatal", "discard"):
            how = f"{_STATUS.sub('', how)} ({failure.call} {failure.what})"
        super().__init__(f"{failure.unit} does not start: {how}{reason}")
        self.failure = failure


class InvalidOptions(CosimError, ValueError):
    """Options of a master that are invalid or contradict each other; `faults` lists everything that is wrong."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(first_faults(faults)))
        self.faults = tuple(faults)
