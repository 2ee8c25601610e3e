"""What the C sources of native test units declare, read out of the compiled library: see `native/frame/unit.h`."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

PARAMETER, INPUT, OUTPUT = range(3)
REAL, INTEGER, BOOLEAN, BINARY, CLOCK = range(5)
NO_STATES, FIXED_STEP, INTERPOLATES, DERIVATIVES, EVENTS, EARLY_RETURN, _, TUNABLE_PARAMETERS = (
    1 << i for i in range(8)
)


class _Variable(ctypes.Structure):
    """`Variable` of native/frame/unit.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("causality", ctypes.c_int),
        ("type", ctypes.c_int),
        ("offset", ctypes.c_size_t),
        ("length", ctypes.c_size_t),
        ("start", ctypes.c_double),
        ("unit", ctypes.c_char_p),
        ("depends", ctypes.c_char_p),
        ("clock", ctypes.c_char_p),
        ("discrete", ctypes.c_int),
        ("counter", ctypes.c_int),
        ("resolution", ctypes.c_int),
        ("timing", ctypes.c_char_p),
    )


class _Model(ctypes.Structure):
    """The first fields of `Model` of native/frame/unit.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("variables", ctypes.POINTER(_Variable)),
        ("n_variables", ctypes.c_size_t),
        ("step", ctypes.c_double),
        ("abilities", ctypes.c_int),
    )


@dataclass(frozen=True)
class Variable:
    """A row of a unit's table; `place` counts them from 1."""

    place: int
    name: str
    causality: int
    type: int
    length: int
    start: float
    unit: str
    depends: tuple[str, ...]
    clock: str
    discrete: bool
    counter: int
    resolution: int
    timing: str

    @property
    def is_continuous(self) -> bool:
        """Whether it varies between steps and events."""
        return self.type == REAL and not self.discrete and not self.clock


@dataclass(frozen=True)
class Declaration:
    """What a C source says of a unit."""

    name: str
    variables: tuple[Variable, ...]
    step: float
    abilities: int

    @property
    def needs_fmi3(self) -> bool:
        """Whether it has variables that FMI 2 does not know."""
        return any(v.type >= BINARY or v.length for v in self.variables)

    def place(self, name: str) -> int:
        """Return a variable's place among all, counted from 1."""
        return next(v.place for v in self.variables if v.name == name)

    def reference(self, name: str, fmi: int = 3) -> int:
        """Return a variable's value reference: its place, in FMI 2 among the variables of its type."""
        place = self.place(name)
        if fmi == 3:
            return place
        return sum(v.type == self.variables[place - 1].type for v in self.variables[:place])


def read_declarations(library: Path) -> list[Declaration]:
    """Return what a compiled library's units declare."""
    loaded = ctypes.CDLL(str(library))
    count = ctypes.c_size_t.in_dll(loaded, "n_native_models").value
    models = (ctypes.POINTER(_Model) * count).in_dll(loaded, "native_models")
    read = [_declaration(pointer.contents) for pointer in models]
    assert len({d.name for d in read}) == len(read), "two units have one name"
    return read


def _declaration(model: _Model) -> Declaration:
    def text(value: bytes | None) -> str:
        return (value or b"").decode()

    variables = tuple(
        Variable(
            i + 1, text(v.name), v.causality, v.type, v.length, v.start, text(v.unit), tuple(text(v.depends).split()),
            text(v.clock), bool(v.discrete), v.counter, v.resolution, text(v.timing),
        )
        for i, v in enumerate(model.variables[: model.n_variables])
    )  # fmt: skip
    return Declaration(text(model.name), variables, model.step, model.abilities)
