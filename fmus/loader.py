"""Starts an FMU's Python side inside a host: the first of its Python files to run, and the only one not imported.

An FMU's modules live in `sys.modules` under a prefix made of their content's hash, as in `_fmu_8d3f.plants.tendon_arm`;
their imports are resolved by an `__import__` of their own. So they neither see nor change modules of the same names
that belong to the host, to other FMUs or to other versions of this one. Standard library only.
"""

import builtins
import importlib
import importlib.machinery
import importlib.metadata
import importlib.util
import json
import linecache
import os
import re
import site
import sys
import threading
import traceback
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

_builtin_import = builtins.__import__

_PREFIX = re.compile(r"(?<![\w./\\])_fmu_\w+\.(?=\w)")
"""The prefix of a module's name, but not where it is a part of a path."""


class HostError(Exception):
    """The host or its installation is at fault; logged without a traceback, which would not help."""

    is_refusal = True


class MissingPackages(HostError):
    """The Python that runs the FMU does not have packages that it needs: the distributions `missing`."""

    def __init__(self, message: str, missing: Sequence[str]) -> None:
        super().__init__(message)
        self.missing = missing


class MissingSource(ModuleNotFoundError):
    """The FMU itself lacks a module; logged without a traceback."""

    is_refusal = True


def start(resources: str, token: str, memory: "Callable[[int], Any] | None" = None) -> Any:
    """Return an instance's Python side, a `handover.fmus.slave.Slave`.

    Args:
        resources: the unpacked FMU's folder `resources`.
        token: the GUID or instantiation token that the host read from the model description.
        memory: allocates that many bytes for the variables; without it the memory is this process's own.

    Raises:
        HostError: the token is that of another FMU, or packages are missing or cannot be imported.
    """
    with open(os.path.join(resources, "unit.json"), encoding="utf-8") as file:
        unit = json.load(file)
    if token != unit["token"]:
        raise HostError(
            f"the model description's token {token} is not that of the resources, which is {unit['token']}:"
            " they are of two different builds. Cure: unpack the FMU again, into an empty folder, or build it again"
        )
    _require(unit, resources)
    modules = _modules(unit["prefix"], os.path.join(resources, "sources"))
    module, _, name = unit["block"].partition(":")
    try:
        with modules.load("handover.cosim.imported_elsewhere").ImportedElsewhere.installed():
            block = getattr(modules.load(module), name)
            for deferred in getattr(block, "deferred", ()):  # in the host's own thread: libcosim steps units in others
                modules.import_from(deferred)
    except Exception as error:
        failure = modules.load("handover.fmus.import_failure")
        if getattr(error, "is_refusal", False) or not failure.is_of_a_package(error):
            raise
        raise HostError(f"unit {unit['unit']} cannot be loaded: {failure.explain_import(error)}") from error
    return modules.load("handover.fmus.slave").Slave(block, unit["form"], unit["start"], memory)


def warning(resources: str) -> str:
    """Return a warning for the log if packages are older than when the FMU was built, else an empty string."""
    with open(os.path.join(resources, "unit.json"), encoding="utf-8") as file:
        packages: list[dict[str, str]] = json.load(file)["packages"]
    versions = [(p["distribution"], p["version"], _installed(p["distribution"])) for p in packages]
    return "; ".join(
        f"{name}: built with {built}, found {present}"
        for name, built, present in versions
        if _release(present) < _release(built)
    )


def explain(error: BaseException) -> str:
    """Return an exception as text for the log: its message if it rejects a call, else the traceback.

    The FMU's modules have their usual names in it, without the prefix under which they are kept.
    """
    if getattr(error, "is_refusal", False):
        return _PREFIX.sub("", str(error))
    return _PREFIX.sub("", "".join(traceback.format_exception(type(error), error, error.__traceback__)).rstrip())


def _require(unit: dict[str, Any], resources: str) -> None:
    """Check that the packages are importable; if not, try those of the environment in which the FMU was built."""
    if not _missing(unit):
        return
    if (
        sys.flags.ignore_environment
    ):  # as when the runtime has started Python; an installation may depend on this variable
        sys.path += [f for f in os.environ.get("PYTHONPATH", "").split(os.pathsep) if f and f not in sys.path]
    noted = _noted(os.path.join(resources, "python.txt"))
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    if noted.get("version") == [version]:
        for folder in noted.get("site", []):
            if os.path.isdir(folder):
                site.addsitedir(folder)
        importlib.invalidate_caches()
    missing = _missing(unit)
    if missing:
        names = ", ".join(f"{p['distribution']} (built with version {p['version']})" for p in missing)
        wanted = " ".join(f"{p['distribution']}=={p['version']}" for p in missing)
        raise MissingPackages(
            f"unit {unit['unit']} needs packages that this Python does not have: {names}."
            f" This is Python {sys.version.split()[0]}, prefix {sys.prefix}, executable {sys.executable or 'unknown'}."
            f" Cure: install them into it, for instance with `python -m pip install {wanted}`,"
            " or choose another Python with the environment variable FMU_PYTHON (hosts that are not Python).",
            [p["distribution"] for p in missing],
        )


def _missing(unit: dict[str, Any]) -> list[dict[str, str]]:
    return [p for p in unit["packages"] if p["module"] not in sys.modules and not _findable(p["module"])]


def _findable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def _installed(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _release(version: str) -> tuple[int, ...]:
    """Return major and minor; a version that is unknown, or does not begin with a number, counts as the newest."""
    numbers = re.match(r"(\d+)(?:\.(\d+))?", version)
    return tuple(int(n or 0) for n in numbers.groups()) if numbers else (sys.maxsize,)


def _noted(path: str) -> dict[str, list[str]]:
    """Return python.txt's lines `name = value` as lists of values by name."""
    noted: dict[str, list[str]] = {}
    if os.path.isfile(path):
        with open(path, encoding="utf-8", errors="surrogateescape") as file:
            for line in file:
                name, _, value = line.rstrip("\n").partition(" = ")
                noted.setdefault(name, []).append(value)
    return noted


def _modules(prefix: str, folder: str) -> "_PrivateModules":
    """Return the modules under a prefix; instances of the same FMU share those that are loaded."""
    root = types.ModuleType(prefix, "Modules of an FMU.")
    root.__path__ = []
    vars(root)["modules"] = _PrivateModules(prefix)
    modules: _PrivateModules = vars(sys.modules.setdefault(prefix, root))["modules"]
    modules.move_to(folder)  # an earlier instance's folder may be gone
    return modules


class _PrivateModules:
    """The modules of one FMU. The methods take names without the prefix."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.folder = ""
        self.own: dict[str, bool] = {}
        self.lock = threading.RLock()
        self.builtins = {**vars(builtins), "__import__": self.import_from}

    def move_to(self, folder: str) -> None:
        """Take what is not loaded yet, and data, from another folder of the same FMU."""
        for full, module in list(sys.modules.items()) if folder != self.folder else ():
            if full.startswith(f"{self.prefix}.") and module.__file__ is not None:
                module.__file__ = folder + module.__file__[len(self.folder) :]
        self.folder = folder
        self.own = {}  # the other folder may have been incomplete

    def load(self, name: str) -> types.ModuleType:
        """Return a module; it is loaded if it is not yet, after the packages that contain it."""
        with self.lock:
            full = f"{self.prefix}.{name}"
            if full not in sys.modules:
                package, _, last = name.rpartition(".")
                parent = self.load(package) if package else sys.modules[self.prefix]
                setattr(parent, last, self._execute(name, full))
            return sys.modules[full]

    def import_from(
        self,
        name: str,
        globals: Mapping[str, Any] | None = None,  # noqa: A002 - the names that __import__ has
        locals: Mapping[str, Any] | None = None,  # noqa: A002
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> types.ModuleType:
        """Import as `__import__` does; the FMU's modules call this in its place."""
        if level and globals:
            name = importlib.util.resolve_name("." * level + name, globals["__package__"])[len(self.prefix) + 1 :]
        elif not self._is_own(name.partition(".")[0]):
            return _builtin_import(name, globals, locals, fromlist or (), level)
        module = self.load(name)
        if not fromlist:
            return self.load(name.partition(".")[0])
        for imported in fromlist:
            if imported != "*" and not hasattr(module, imported) and self._place(f"{name}.{imported}"):
                self.load(f"{name}.{imported}")
        return module

    def _is_own(self, top: str) -> bool:
        """Return whether a package is the FMU's own; asked in each step, as numpy imports where it reads a dtype."""
        own = self.own  # another thread may move to another folder meanwhile
        if top not in own:
            own[top] = self._place(top) is not None
        return own[top]

    def _place(self, name: str) -> str | None:
        """Return a module's file; for a package its `__init__.py`, or its folder if it has none."""
        base = os.path.join(self.folder, *name.split("."))
        candidates = (f"{base}.py", os.path.join(base, "__init__.py"), base)
        return next((c for c in candidates if os.path.exists(c)), None)

    def _execute(self, name: str, full: str) -> types.ModuleType:
        path = self._place(name)
        if path is None:
            raise MissingSource(
                f"the FMU has no module {name!r}. Cure: unpack it again, into an empty folder, or build it again",
                name=name,
            )
        is_package = not path.endswith(f"{name.rpartition('.')[2]}.py")
        source = _source(path)
        module = types.ModuleType(full)
        module.__file__ = path
        module.__package__ = full if is_package else full.rpartition(".")[0]
        module.__spec__ = importlib.machinery.ModuleSpec(full, None, origin=path, is_package=is_package)
        vars(module)["__builtins__"] = self.builtins
        if is_package:
            module.__path__ = []
        sys.modules[full] = module
        try:
            exec(compile(source, path, "exec", dont_inherit=True), vars(module))
        except BaseException:
            del sys.modules[full]
            raise
        return module


def _source(path: str) -> str:
    """Return a module's source; its lines are cached for tracebacks, as the host may delete the FMU's folder."""
    if os.path.isdir(path):
        return ""
    with open(path, "rb") as file:
        content = file.read()
    try:
        source = content.decode()
    except UnicodeDecodeError as error:
        raise SyntaxError(f"not UTF-8: {error}", (path, content.count(b"\n", 0, error.start) + 1, None, None)) from None
    if "\0" in source:
        raise SyntaxError("a zero byte", (path, source.count("\n", 0, source.index("\0")) + 1, None, None))
    linecache.cache[path] = (len(source), None, source.splitlines(keepends=True), path)
    return source
