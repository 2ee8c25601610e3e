"""Which machines an FMU has libraries for, and whether they are what their folders say, before one is loaded."""

from collections.abc import Iterator
from pathlib import PurePosixPath

from handover.cosim.check.finding import Finding, fault, warning
from handover.cosim.fmu.archive import FmuArchive
from handover.cosim.fmu.fmpy_edge import library_path, platform_folder
from handover.cosim.fmu.library_format import HEAD, platforms_of, shortage

_FMI2_FOLDERS = {
    "linux32": ("x86-linux",),
    "linux64": ("x86_64-linux",),
    "win32": ("x86-windows",),
    "win64": ("x86_64-windows",),
    "darwin64": ("x86_64-darwin", "aarch64-darwin"),
}
_SUFFIXES = (".so", ".dll", ".dylib")


def platforms_in(archive: FmuArchive) -> list[str]:
    """Return the folders of `binaries/` that hold a shared library."""
    return sorted({p.parts[1] for p in _libraries(archive)})


def binary_findings(archive: FmuArchive, fmi: int, identifier: str) -> Iterator[Finding]:
    """Yield what is wrong with the libraries' names, folders, formats and lengths."""
    wanted = library_path(fmi, identifier)
    if wanted not in archive.names:
        yield _missing(archive, fmi, identifier)
    for library in _libraries(archive):
        if library.stem == identifier:
            yield from _format_findings(archive, library, fmi, here=str(library) == wanted)
        if short := shortage(archive.head(str(library), HEAD), archive.size(str(library))):
            tell = fault if library.parts[1] == platform_folder(fmi) else warning
            yield tell(short, where=str(library))


def _libraries(archive: FmuArchive) -> list[PurePosixPath]:
    paths = [PurePosixPath(n) for n in archive.names if n.startswith("binaries/") and n.endswith(_SUFFIXES)]
    return [p for p in paths if len(p.parts) == 3]


def _missing(archive: FmuArchive, fmi: int, identifier: str) -> Finding:
    """Tell why there is no library for this machine: of another name, in another standard's folder, or not at all."""
    folder, has = platform_folder(fmi), platforms_in(archive)
    wanted = library_path(fmi, identifier)
    here = [p.name for p in _libraries(archive) if p.parts[1] == folder]
    other = platform_folder(5 - fmi)
    if here:
        what = f"no library is named like the modelIdentifier {identifier!r}; there is {', '.join(here)}"
        return fault(what, where=f"binaries/{folder}", cure=f"{wanted} is wanted")
    if other in has:
        what = f"the library for this machine is in the folder of FMI {5 - fmi}.0, {other}"
        return fault(what, where="binaries", cure=f"{wanted} is wanted")
    sources = any(n.startswith("sources/") and not n.endswith("/") for n in archive.names)
    what = f"no library for this machine ({folder}); there are libraries for {', '.join(has) or 'none'}"
    if sources:
        return fault(what, where="binaries", cure="it carries C sources: compile it, for instance with `fmpy compile`")
    return fault(what, where="binaries", cure=f"export it for this platform too: {wanted}")


def _format_findings(archive: FmuArchive, library: PurePosixPath, fmi: int, *, here: bool) -> Iterator[Finding]:
    made_for = platforms_of(archive.head(str(library), HEAD))
    folder = library.parts[1]
    meant = _FMI2_FOLDERS.get(folder, ()) if fmi == 2 else ("-".join(folder.split("-")[:2]),)  # an ABI may follow
    if here and not made_for:
        yield fault("not a shared library", where=str(library))
    elif meant and not set(made_for) & set(meant):
        tell = fault if here else warning
        yield tell(f"made for {' and '.join(made_for) or 'no known platform'}, not for {folder}", where=str(library))
