"""What a distribution requires, and folders like site-packages that have that and nothing else."""

from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement


def distributions(name: str, extras: Iterable[str] = ()) -> set[str]:
    """Return the names of a distribution and of all that it requires, without extras that are not asked for."""
    found: set[tuple[str, str]] = set()
    waiting = [(name, extra) for extra in ("", *extras)]
    while waiting:
        of, extra = waiting.pop()
        if (of, extra) in found:
            continue
        found.add((of, extra))
        for requirement in map(Requirement, metadata.requires(of) or []):
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                waiting += [(requirement.name, wanted) for wanted in ("", *requirement.extras)]
    return {of for of, _ in found}


def link_distributions(names: Iterable[str], folder: Path) -> None:
    """Link what distributions have installed, but for those that are installed as links to sources, into a folder."""
    for name in names:
        for top in {Path(file.parts[0]) for file in metadata.files(name) or [] if file.parts[0] != ".."}:
            place = Path(str(metadata.distribution(name).locate_file(top)))
            if place.exists() and not (folder / top).exists() and "__editable__" not in top.name:
                (folder / top).symlink_to(place)
