"""The rows of the table of faults: what is right where a unit does one thing wrong in one call, in each way to run.

The ways are the compiled plan, the master's general path, where the same is right, and the unit in a process of its
own, where a crash ends that alone. Faults and calls are named as `units/by_name/faults.c` knows them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

WAYS: dict[str, tuple[str, ...]] = {
    "plan": (),
    "general": ("--algorithm", "fixed-point"),
    "isolated": ("--isolate", "b"),
}
"""The options of `handover run` with which a run goes each way; the plan supports no coupling that iterates."""

WHOLE = 11
"""Rows of a run that comes to its end, one each 0.1 s."""

UNTIL_FAULT, UNTIL_OUTPUT = 4, 3
"""Rows of one that ends in a step from 0.3 s on, or in what is set for it; or in outputs that are got at 0.3 s."""

LIMIT = 2.0
"""Seconds for a call."""

NOTES = ("a terminated", "a freed", "c terminated", "c freed")
ALL, FREED, NONE = frozenset(NOTES), frozenset({"a freed", "c freed"}), frozenset[str]()
ONLY_A, WITHOUT_C = frozenset({"a freed"}), ALL - {"c terminated"}

CALLS = {
    "load": ("loading", "loading"),
    "instantiate": ("fmi2Instantiate", "fmi3InstantiateCoSimulation"),
    "setup": ("fmi2SetupExperiment", ""),
    "enter": ("fmi2EnterInitializationMode", "fmi3EnterInitializationMode"),
    "exit": ("fmi2ExitInitializationMode", "fmi3ExitInitializationMode"),
    "set": ("fmi2SetReal", "fmi3SetFloat64"),
    "get": ("fmi2GetReal", "fmi3GetFloat64"),
    "binary": ("", "fmi3GetBinary"),
    "step": ("fmi2DoStep", "fmi3DoStep"),
    "save": ("fmi2GetFMUstate", "fmi3GetFMUState"),
    "terminate": ("fmi2Terminate", "fmi3Terminate"),
    "free": ("fmi2FreeInstance", "fmi3FreeInstance"),
    "unload": ("unloading", "unloading"),
}
"""The calls in which something goes wrong, by the name in a fault's, as FMI 2 and FMI 3 call them."""


@dataclass(frozen=True)
class Right:
    """What is right of a run.

    Attributes:
        status: of the command.
        reported: what is printed of it, besides the unit's name; `{call}` is the standard's name of the call.
        rows: recorded; None: no folder is left.
        notes: of the sound units.
        off: what the sound units' outputs may be off, relative to them: what the unit itself computes in its own
            rounding feeds c, and in one process rounding is put back at communication points.
    """

    status: int = 0
    reported: tuple[str, ...] = ()
    rows: int | None = WHOLE
    notes: frozenset[str] = ALL
    off: float = 0.0


@dataclass(frozen=True)
class Fault:
    """A row.

    Attributes:
        fault, call: what goes wrong, and where.
        right: of the plan, and of the other ways where they do not differ.
        differs: what is right in ways where that is something else.
        left_out: why the fault does not apply in a way.
        fast: ways in which it is tried in the fast tier, in one of the standards.
    """

    fault: str
    call: str
    right: Right = field(default_factory=Right)
    differs: Mapping[str, Right] = field(default_factory=dict[str, Right])
    left_out: Mapping[str, str] = field(default_factory=dict[str, str])
    fast: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """What the unit's library is named."""
        return f"{self.fault}_in_{self.call}"

    @property
    def standards(self) -> tuple[int, ...]:
        """The standards that have the call."""
        return tuple(fmi for fmi in (2, 3) if CALLS[self.call][fmi - 2])

    def options(self, way: str) -> tuple[str, ...]:
        """Return the options of `handover run`: states are saved where a step may be repeated."""
        if self.call != "save":
            return WAYS[way]
        return ("--repeat-discarded", *(WAYS[way] if way == "isolated" else ()))

    @property
    def ways(self) -> tuple[str, ...]:
        """The ways in which it applies."""
        return tuple(way for way in WAYS if way not in self.left_out)

    def right_in(self, way: str) -> Right:
        """Return what is right in a way."""
        return self.differs.get(way, self.right)


AT_THE_END = ("terminate", "free", "unload")
NOTES_BEFORE_START = {"load": ONLY_A, "instantiate": ONLY_A, "setup": FREED, "enter": FREED, "exit": WITHOUT_C}
"""What the sound units note where b fails before the run has begun: a is loaded before b, c after it."""

NO_STATES = "the plan saves no states: with --repeat-discarded the run goes on the general path"
PLAN = ("plan",)
SEGMENT = "segmentation fault"
TRAPPED = "floating point exception"
NO_START = ("b does not start", "the solver failed", "({call} answered Error)")
HANG = "did not return within 2 s"


def crash(fault: str, call: str, how: str, *, notes: frozenset[str] = NONE, fast: tuple[str, ...] = ()) -> Fault:
    """Return a row of a crash: in one process it ends all units, which note nothing more, else that unit alone."""
    output = call in ("get", "binary")
    rows = None if call in NOTES_BEFORE_START else WHOLE if call in AT_THE_END else UNTIL_FAULT - output
    at = 0 if rows is None else 1 if call in AT_THE_END else 0.3
    right = Right(3, ("unit b crashed in {call}", f"at t = {at} s: ", how), rows, notes)
    own = "it ended its process with status 0" if how.startswith("it ended") else how
    left_out = {"plan": NO_STATES} if call == "save" else {}
    alone = replace(right, reported=(*right.reported[:-1], own), notes=NOTES_BEFORE_START.get(call, ALL))
    return Fault(fault, call, right, {"isolated": alone}, left_out, fast)


def failure(
    fault: str, call: str, status: int, *reported: str, rows: int | None = WHOLE, notes: frozenset[str] = ALL,
    isolated: frozenset[str] | None = None, fast: tuple[str, ...] = (),
) -> Fault:  # fmt: skip
    """Return a row of an error that is reported; `isolated` are the sound units' notes where they differ."""
    right = Right(status, reported, rows, notes)
    return Fault(
        fault, call, right, {} if isolated is None else {"isolated": replace(right, notes=isolated)}, fast=fast
    )


def harmless(fault: str, call: str, *, off: float = 0.0, fast: tuple[str, ...] = ()) -> Fault:
    """Return a row of what harms nothing else."""
    return Fault(fault, call, Right(off=off), fast=fast)


def warned(call: str, n: int) -> Fault:
    """Return a row of calls that answer Warning: the run goes on, and they are reported with their number."""
    times = "once, at t = 0 s" if n == 1 else f"{n} times, first at t = 0.3 s"
    reported = f"unit b returned Warning from {{call}} {times}; last message: {call}: the step size was halved"
    return Fault("warning", call, Right(reported=(reported,)))


FAULTS = [
    crash("crash", "load", SEGMENT, fast=PLAN),
    crash("crash", "instantiate", SEGMENT),
    crash("crash", "setup", SEGMENT),
    crash("crash", "enter", SEGMENT),
    crash("crash", "exit", SEGMENT),
    crash("crash", "set", SEGMENT),
    crash("crash", "get", SEGMENT, fast=("isolated",)),
    crash("crash", "step", SEGMENT, fast=PLAN),
    crash("crash", "save", SEGMENT),
    crash("crash", "terminate", SEGMENT, notes=frozenset({"c terminated"})),
    crash("crash", "free", SEGMENT, notes=ALL - {"a freed"}),
    crash("crash", "unload", SEGMENT, notes=ALL - {"a freed"}),
    crash("divide", "step", ""),
    crash("abort", "load", "aborted"),
    crash("abort", "step", "aborted"),
    crash("exit", "step", "it ended the process with status 0"),
    crash("leave", "load", "it ended the process with status 0"),
    crash("leave", "step", "it ended the process with status 0"),
    crash("overflow", "step", SEGMENT),
    crash("overrun", "step", SEGMENT),
    crash("double_free", "step", "aborted"),
    failure("null", "binary", 3, "b: {call} at t = 0.3 s", "NULL for blob", rows=UNTIL_OUTPUT, fast=("isolated",)),
    crash("garbage", "binary", SEGMENT),
    failure("hang", "load", 3, "b", HANG, rows=None, notes=NONE, isolated=ONLY_A),
    failure("hang", "enter", 3, "b", "{call}", HANG, rows=None, notes=FREED),
    failure("hang", "step", 3, "b: {call} at t = 0.3 s", HANG, rows=UNTIL_FAULT),
    failure("hang", "terminate", 3, "b: {call} at t = 1 s", HANG),
    failure("hang", "free", 3, "b: {call} at t = 1 s", HANG),
    failure("hang", "unload", 3, "b", HANG),
    failure("error", "instantiate", 2, ".fmu: b: ", "the solver failed", rows=None, notes=ONLY_A),
    failure("error", "setup", 2, *NO_START, rows=None, notes=FREED),
    failure("error", "enter", 2, *NO_START, rows=None, notes=FREED, fast=PLAN),
    failure("error", "exit", 2, *NO_START, rows=None, notes=WITHOUT_C),
    failure("error", "set", 3, "b: {call} at t = 0.3 s", "the solver failed", rows=UNTIL_FAULT),
    failure("error", "get", 3, "b: {call} at t = 0.3 s", "the solver failed", rows=UNTIL_OUTPUT),
    failure("error", "step", 3, "b: {call} at t = 0.3 s", "the solver failed", rows=UNTIL_FAULT),
    failure("error", "terminate", 3, "b: {call} at t = 1 s", "the solver failed"),
    failure("discard", "exit", 2, "b does not start: {call} answered Discard", rows=None, notes=WITHOUT_C),
    failure("fatal", "enter", 2, *NO_START[:1], "memory is corrupt", "({call} answered Fatal)", rows=None, notes=FREED),
    failure("fatal", "step", 3, "b: {call} at t = 0.3 s", "memory is corrupt", rows=UNTIL_FAULT, fast=PLAN),
    failure("discard", "step", 3, "b: {call} at t = 0.3 s", "Discard", rows=UNTIL_FAULT),
    failure("unknown", "step", 3, "b: {call} at t = 0.3 s", "77", rows=UNTIL_FAULT),
    failure("negative", "step", 3, "b: {call} at t = 0.3 s", "-2", rows=UNTIL_FAULT),
    failure("nan", "get", 3, "b: {call} at t = 0.3 s", "y = NaN", rows=UNTIL_OUTPUT, fast=("general",)),
    failure("infinity", "get", 3, "b: {call} at t = 0.3 s", "y = infinity", rows=UNTIL_OUTPUT),
    warned("exit", 1),
    warned("set", 7),
    warned("get", 8),
    warned("step", 7),
    crash("exhaust", "step", ""),
    harmless("flood", "step"),
    harmless("log_null", "step"),
    harmless("log_bytes", "step", fast=PLAN),
    harmless("log_huge", "step"),
    harmless("chdir", "load"),
    harmless("chdir", "step"),
    harmless("close_output", "step"),
    harmless("close_all", "load"),
    harmless("close_all", "step"),
    harmless("handlers", "load"),
    harmless("handlers", "step"),
    harmless("rounding", "load"),
    harmless("rounding", "step", off=1e-14),
    harmless("trap", "load"),
    harmless("trap", "step"),
    crash("trap_division", "step", TRAPPED),
    crash("trap_division", "get", TRAPPED),
    failure("trap_infinity", "get", 3, "b: {call} at t = 0.3 s", "y = infinity", rows=UNTIL_OUTPUT),
    harmless("fork", "step"),
    harmless("duplicate", "step", fast=("isolated",)),
    harmless("duplicate", "get"),
]
