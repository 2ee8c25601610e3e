"""A small host: loads an FMU's library with ctypes and calls the standard's functions by name."""

import copy
import ctypes
import shutil
import tempfile
import weakref
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.compile import host_platform, library

OK, DISCARD, ERROR = 0, 2, 3

DOUBLE, SIZE, BOOL = ctypes.c_double, ctypes.c_size_t, ctypes.c_bool
INTEGERS: dict[str, Any] = {
    f"{sign}Int{bits}": getattr(ctypes, f"c_{sign.lower()}int{bits}") for bits in (8, 16, 32, 64) for sign in ("", "U")
}
"""C's types of integers by FMI 3's names."""
C_TYPES: dict[str, Any] = {
    **INTEGERS,
    "Real": DOUBLE,
    "Float64": DOUBLE,
    "Float32": ctypes.c_float,
    "Integer": ctypes.c_int,
    "String": ctypes.c_char_p,
}
Log2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
Log3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Callbacks(ctypes.Structure):
    _fields_ = [
        ("logger", Log2),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    ]


class CtypesHost:
    """One FMU, unpacked and loaded, with at most one instance; `another` has one more.

    Attributes:
        log: messages so far, as the host gets them.
        categories: their categories.
        names: the instance's name with each, in FMI 2.
        logging: whether the next instance is made with logging on.
        references: value references by variable's name; of an array in FMI 2 that of its first entry.
        event_needed, terminate, early, last_time: what the last step answered (FMI 3).
    """

    def __init__(self, fmu: Path, fmi: int, prefix: str = "a 100% größerer Ordner ") -> None:
        self.fmi = fmi
        self.log: list[str] = []
        self.folder = Path(tempfile.mkdtemp(prefix=prefix))
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(self.folder)
        root = ET.parse(self.folder / "modelDescription.xml").getroot()
        self.token = root.attrib["guid" if fmi == 2 else "instantiationToken"]
        variables = [v.attrib for v in root.iter() if {"name", "valueReference"} <= v.attrib.keys()]
        self.references: dict[str, int] = {}
        for v in variables:
            self.references.setdefault(v["name"].partition("[")[0], int(v["valueReference"]))
        folder = FMI2_FOLDERS[host_platform()] if fmi == 2 else host_platform()
        suffix = library(host_platform(), fmi).suffix
        self.library = ctypes.CDLL(str(self.folder / "binaries" / folder / (root.attrib["modelName"] + suffix)))
        self.instance: int | None = None
        self._owner: CtypesHost | None = None
        self._remove = weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
        self.categories: list[str] = []
        self.names: list[str] = []
        self.logging = False
        self._log2 = Log2(self._take_2)
        self.logger3 = Log3(self._take_3)
        self.callbacks = Callbacks(logger=self._log2)

    def instantiate(self, token: str | None = None, *, event_mode: bool = False, early_return: bool = False) -> bool:
        """Make the instance; return whether it was made."""
        given = (token or self.token).encode()
        resources = self.folder / "resources"
        if self.fmi == 2:
            make = self.library.fmi2Instantiate
            arguments: tuple[Any, ...] = (
                b"x",
                1,
                given,
                resources.as_uri().encode(),
                ctypes.byref(self.callbacks),
                0,
                int(self.logging),
            )
        else:
            make = self.library.fmi3InstantiateCoSimulation
            flags = (BOOL(False), BOOL(False), BOOL(event_mode), BOOL(early_return))
            path = f"{resources}/".encode()
            flags = (flags[0], BOOL(self.logging), *flags[2:])
            arguments = (b"x", given, path, *flags, None, SIZE(0), None, self.logger3, None)
        make.restype = ctypes.c_void_p
        self.instance = make(*arguments)
        return self.instance is not None

    def _take_2(self, _environment: object, name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.names.append(name.decode())
        self._take_3(_environment, status, category, message)

    def _take_3(self, _environment: object, _status: int, category: bytes, message: bytes) -> None:
        self.categories.append(category.decode())
        self.log.append(message.decode())

    def call(self, function: str, *arguments: Any) -> int:
        """Call fmi2... or fmi3... with the instance; return the status."""
        return getattr(self.library, f"fmi{self.fmi}{function}")(ctypes.c_void_p(self.instance), *arguments)

    def initialise(self, start: float = 0.0) -> int:
        """Go through initialisation mode."""
        return self.enter(start) or self.call("ExitInitializationMode")

    def enter(self, start: float = 0.0) -> int:
        """Enter initialisation mode."""
        times = (BOOL(False), DOUBLE(0.0), DOUBLE(start), BOOL(False), DOUBLE(0.0))
        if self.fmi == 3:
            return self.call("EnterInitializationMode", *times)
        return self.call("SetupExperiment", 0, DOUBLE(0.0), DOUBLE(start), 0, DOUBLE(0.0)) or self.call(
            "EnterInitializationMode"
        )

    def step(self, t: float, dt: float) -> int:
        """Do a step."""
        if self.fmi == 2:
            return self.call("DoStep", DOUBLE(t), DOUBLE(dt), 0)
        flags = (BOOL * 3)()
        last = DOUBLE()
        pointers = [ctypes.byref(flags, i) for i in range(3)]
        status = self.call("DoStep", DOUBLE(t), DOUBLE(dt), BOOL(False), *pointers, ctypes.byref(last))
        self.event_needed, self.terminate, self.early = flags
        self.last_time = last.value
        return status

    def update(self) -> int:
        """Update discrete states in event mode; `next_event` is then the time of the next event, or None."""
        flags, time = (BOOL * 5)(*[True] * 5), DOUBLE(-1.0)
        pointers = [ctypes.byref(flags, i) for i in range(5)]
        status = self.call("UpdateDiscreteStates", *pointers, ctypes.byref(time))
        assert status != OK or list(flags)[:4] == [False] * 4
        self.next_event = time.value if flags[4] else None
        return status

    def set_clock(self, value: bool = True) -> int:
        """Activate the unit's clock."""
        reference = ctypes.c_uint32(self.references["sample_clock"])
        return self.call("SetClock", ctypes.byref(reference), SIZE(1), ctypes.byref(BOOL(value)))

    def set(self, name: str, values: Sequence[float]) -> int:
        """Set a real variable, by the name of its first entry in FMI 2."""
        return self.put("Real" if self.fmi == 2 else "Float64", name, *values)

    def get(self, name: str, n: int = 1) -> list[float]:
        """Get a real variable; it must succeed."""
        return self.take("Real" if self.fmi == 2 else "Float64", name, n)

    def put(self, kind: str, name: str, *values: Any) -> int:
        """Set a variable of any kind but binary, such as `Int8` or `String`; `Integer` is `Int64` in FMI 3."""
        kind, c_type = self._kind(kind)
        return self.transfer(f"Set{kind}", name, (c_type * len(values))(*values))

    def take(self, kind: str, name: str, n: int = 1) -> list[Any]:
        """Get a variable of any kind but binary; it must succeed."""
        kind, c_type = self._kind(kind)
        values = (c_type * n)()
        assert self.transfer(f"Get{kind}", name, values) == OK, self.log[-1]
        return list(values)

    def _kind(self, kind: str) -> tuple[str, Any]:
        if kind == "Boolean":
            return kind, BOOL if self.fmi == 3 else ctypes.c_int
        kind = "Int64" if kind == "Integer" and self.fmi == 3 else kind
        return kind, C_TYPES[kind]

    def transfer(self, function: str, name: str, values: "ctypes.Array[Any]") -> int:
        """Call a function that sets or gets a variable's values."""
        n, first = len(values), self.references[name]
        if self.fmi == 3:
            return self.call(function, ctypes.byref(ctypes.c_uint32(first)), SIZE(1), values, SIZE(n))
        return self.call(function, (ctypes.c_uint32 * n)(*range(first, first + n)), SIZE(n), values)

    def beside(self) -> "CtypesHost":
        """Return a host without an instance in the same folder, which stays when it is closed."""
        other = copy.copy(self)
        other.instance, other.log, other.categories, other.names = None, [], [], []
        other._log2, other.logger3 = Log2(other._take_2), Log3(other._take_3)
        other.callbacks, other._owner = Callbacks(logger=other._log2), self
        return other

    def another(self) -> "CtypesHost":
        """Return a host of one more instance in the same folder, which is initialised."""
        other = self.beside()
        assert other.instantiate(), other.log
        assert other.initialise() == OK, other.log
        return other

    def free(self) -> None:
        """Free the instance."""
        if self.instance is not None:
            self.call("FreeInstance")
        self.instance = None

    def close(self) -> None:
        """Free the instance and remove the unpacked files if they are its own; the library stays loaded."""
        self.free()
        if self._owner is None:
            self._remove()
