"""Which modules and data an FMU must contain to run its block, and which packages it needs from its environment.

They are found by following the import statements in the sources, without running them. Data are what a module names as
`Path(__file__).with_name("NAME")`, a file or a folder of files.
"""

import ast
import hashlib
import importlib.util
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from importlib.machinery import ModuleSpec
from pathlib import Path

from handover.cosim.exceptions import one_line
from handover.fmus.catalog import UnknownBlock

OWN_PACKAGE = "handover"
"""The package of which every FMU contains sources."""

SLAVE_SIDE = (
    "handover.fmus.slave",
    "handover.fmus.loader",
    "handover.fmus.import_failure",
    "handover.cosim.imported_elsewhere",
    "handover.fmus.server",
    "handover.fmus.interpreter",
)
"""Modules that every FMU contains, whatever its block imports."""


_DATA = re.compile(rb"""Path\(__file__\)\.with_name\(["']([\w.-]+)["']\)""")
_PATH_OF_CLASS = re.compile(r"[^\W\d][\w.]*:\w+")


@dataclass(frozen=True)
class Package:
    """A package of the environment: its top-level module, and the distribution that installs it."""

    module: str
    distribution: str
    version: str


@dataclass(frozen=True)
class Carried:
    """The Python code of an FMU, and its data.

    Attributes:
        files: by their paths in the FMU, such as `handover/plants/helix/arm/tendon_arm.py`.
        imported: names that they import from the environment's packages, sorted: modules, and what is in them.
    """

    files: dict[str, Path]
    imported: tuple[str, ...]

    @property
    def modules(self) -> tuple[str, ...]:
        """Top-level modules of the environment that they import, sorted."""
        return tuple(sorted({name.partition(".")[0] for name in self.imported}))

    def packages(self) -> list[Package]:
        """Return the environment's packages with their versions; modules of no distribution are left out."""
        named = [(module, name) for module in self.modules for name in distributions_by_module().get(module, [])[:1]]
        return [Package(module, name, metadata.version(name)) for module, name in named]


@cache
def distributions_by_module() -> dict[str, list[str]]:
    """Return distributions by top-level module; `packages_distributions` of Python 3.10 misses most of them."""
    by_module: dict[str, set[str]] = {}
    for distribution in metadata.distributions():
        name = distribution.metadata["Name"]
        for top in _top_levels(distribution):
            by_module.setdefault(top, set()).add(name)
    return {top: sorted(names) for top, names in by_module.items()}


def _top_levels(distribution: metadata.Distribution) -> set[str]:
    """Return what a distribution installs at the top; its files are read as text, for they are thousands."""
    if listed := (distribution.read_text("top_level.txt") or "").split():
        return {*listed}
    files = (distribution.read_text("RECORD") or "").splitlines() or map(str, distribution.files or ())
    return {re.split(r"[/,.]", file.lstrip('"'), maxsplit=1)[0] for file in files}


def closure(block: str) -> Carried:
    """Return the sources and packages that a block's module imports, directly or through others, and their data.

    Args:
        block: path of the block's class, such as `handover.plants.helix.arm.tendon_arm:TendonArm`.

    Raises:
        UnknownBlock: its module cannot be found, or is not Python source.
    """
    module, _, name = block.partition(":")
    if not name:
        raise UnknownBlock(block, "there is no ':' between module and class")
    source_file(block)
    carried_tops = {OWN_PACKAGE, module.partition(".")[0]}
    files: dict[str, Path] = {}
    data: dict[str, Path] = {}
    imported: set[str] = set()
    waiting = [module, *SLAVE_SIDE]
    while waiting:
        dotted = waiting.pop()
        for part in _with_packages(dotted):
            top = part.partition(".")[0]
            if top in sys.stdlib_module_names:
                break
            spec = _spec(part)
            if spec is None:
                break
            if top not in carried_tops and (_is_installed(spec) or spec.origin in ("built-in", "frozen")):
                imported.add(dotted)
                break
            path = _path_in_fmu(part, spec)
            if _is_source(spec) and path not in files:
                files[path] = Path(spec.origin or "")
                source = files[path].read_bytes()
                data |= _data_of(path, files[path], source)
                is_package = spec.submodule_search_locations is not None
                package = part if is_package else part.rpartition(".")[0]
                waiting += _imports(source, package, str(files[path]))
    return Carried(dict(sorted({**files, **data}.items())), tuple(sorted(imported)))


def _data_of(path: str, module: Path, source: bytes) -> dict[str, Path]:
    """Return the data files that a module names beside it, by their paths in the FMU."""
    named = (module.with_name(name.decode()) for name in _DATA.findall(source))
    files = (file for data in named for file in (data.rglob("*") if data.is_dir() else [data]) if file.is_file())
    folder = path.rpartition("/")[0]
    return {f"{folder}/{file.relative_to(module.parent).as_posix()}".lstrip("/"): file for file in files}


class FileElsewhere(ValueError):
    """A data file does not lie in the folder of a block's module, or below."""

    def __init__(self, file: Path, folder: Path) -> None:
        super().__init__(f"{file} does not lie in {folder}, the folder of the block's module, or is not a file there")
        self.file, self.folder = file, folder


def beside_block(block: str, files: Sequence[Path]) -> dict[str, Path]:
    """Return data files by their paths in the FMU, beside the block's module as they are here.

    Raises:
        FileElsewhere: one does not lie in the folder of the module's top package, or below, or is none.
    """
    spec = _spec(block.partition(":")[0].partition(".")[0])
    levels = 1 if spec and spec.submodule_search_locations else 0
    folder = Path(spec.origin).resolve().parents[levels] if spec and spec.origin else Path.cwd()
    found: dict[str, Path] = {}
    for file in files:
        if not file.is_file() or not file.resolve().is_relative_to(folder):
            raise FileElsewhere(file, folder)
        found[file.resolve().relative_to(folder).as_posix()] = file
    return found


def carried_digest(path: str) -> str:
    """Return the SHA-256 of a class's module and of those that it imports, but for this package and installed ones.

    So of those of classes that one of them names by a path, such as `my_arm:MyArm`: they are imported with a scenario.

    Raises:
        UnknownBlock: as `closure`.
    """
    files: dict[str, Path] = {}
    waiting, seen = [path], set[str]()
    while waiting:
        seen.add(block := waiting.pop())
        own = {n: f for n, f in closure(block).files.items() if n.partition("/")[0] != OWN_PACKAGE}
        sources = (n for n in own.keys() - files.keys() if n.endswith(".py"))
        named = (name for n in sources for name in _named_classes(own[n].read_bytes(), str(own[n])))
        waiting += [name for name in named if name not in seen and _is_own(name)]
        files |= own
    digest = hashlib.sha256()
    for name, file in sorted(files.items()):
        digest.update(f"{name}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


@cache
def _named_classes(source: bytes, filename: str) -> list[str]:
    """Return the texts of a source that may be paths of classes."""
    texts = (node.value for node in ast.walk(_parsed(source, filename)) if isinstance(node, ast.Constant))
    return [text for text in texts if isinstance(text, str) and _PATH_OF_CLASS.fullmatch(text)]


def _is_own(path: str) -> bool:
    """Return whether a class's module is source here, and neither this package's nor installed."""
    module = path.partition(":")[0]
    spec = _spec(module) if module.partition(".")[0] not in {OWN_PACKAGE, *sys.stdlib_module_names} else None
    return spec is not None and _is_source(spec) and not _is_installed(spec)


def _with_packages(module: str) -> Iterator[str]:
    """Yield a, a.b, a.b.c for a.b.c."""
    parts = module.split(".")
    for i in range(len(parts)):
        yield ".".join(parts[: i + 1])


def _spec(module: str) -> ModuleSpec | None:
    """Return where a module is; unlike `importlib.util.find_spec`, without importing the packages that it is in."""
    if module in sys.modules:
        return getattr(sys.modules[module], "__spec__", None)
    package = module.rpartition(".")[0]
    places: Sequence[str] | None = None
    if package:
        spec = _spec(package)
        if spec is None or spec.submodule_search_locations is None:
            return None
        places = getattr(sys.modules.get(package), "__path__", spec.submodule_search_locations)
    try:
        return next(filter(None, (finder.find_spec(module, places) for finder in sys.meta_path)), None)
    except (ImportError, ValueError):
        return None


def source_file(path: str) -> Path:
    """Return the file of a class's module, which is not imported.

    Raises:
        UnknownBlock: it cannot be found, or is not Python source.
    """
    module = path.partition(":")[0]
    spec = _spec(module)
    if spec is None or not spec.origin or not _is_source(spec):
        raise UnknownBlock(path, f"module {module!r} cannot be found as Python source")
    return Path(spec.origin)


def _is_source(spec: ModuleSpec | None) -> bool:
    return spec is not None and spec.origin is not None and spec.origin.endswith(".py")


def _is_installed(spec: ModuleSpec) -> bool:
    """Return whether a module lies where installers put packages, so that another environment can have it, too."""
    places = [spec.origin or "", *(spec.submodule_search_locations or [])]
    return any({"site-packages", "dist-packages"} & set(Path(place).parts) for place in places)


def _path_in_fmu(module: str, spec: ModuleSpec) -> str:
    path = module.replace(".", "/")
    return f"{path}/__init__.py" if spec.submodule_search_locations is not None else f"{path}.py"


@cache
def _imports(source: bytes, package: str, filename: str) -> list[str]:
    """Return the absolute names that a source may import; of `from a import b` both a and a.b, as b may be a module.

    Kept by the source's text, as units share most of their modules and the runs of a campaign all of them.
    """
    names: list[str] = []
    for node in _running(_parsed(source, filename)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                base = importlib.util.resolve_name("." * node.level + base, package)
            names += [base] + [f"{base}.{alias.name}" for alias in node.names]
    return names


def _parsed(source: bytes, filename: str) -> ast.Module:
    try:
        return ast.parse(source, filename=filename)
    except (SyntaxError, ValueError, MemoryError, RecursionError) as e:
        fault = f"{filename} is not Python source: {type(e).__name__}: {one_line(e)}"
        raise UnknownBlock(filename, fault) from e


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a tree's statements with what holds them, but not those that only type checkers see."""
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            continue  # no import stands within an expression
        if isinstance(child, ast.If) and "TYPE_CHECKING" in (getattr(child.test, key, "") for key in ("id", "attr")):
            for other in child.orelse:
                yield from _running(other)
        else:
            yield from _running(child)
