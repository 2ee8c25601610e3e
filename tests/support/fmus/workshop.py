"""Sample units for tests."""

import functools
from pathlib import Path

from handover.fmus.build import build_block
from support.fmus.ctypes_host import ERROR, CtypesHost
from support.wording import Wording


class Workshop:
    """Builds each sample block's FMU once and opens hosts on it; closes them all at the end of a test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.open: list[CtypesHost] = []

    def fmu(self, block: str, fmi: int) -> Path:
        made = self.folder / f"{block.rpartition(':')[2]}.fmi{fmi}.fmu"
        return made if made.is_file() else build_block(f"support.sample_units.{block}", fmi, self.folder)

    def scalar_fmu(self, block: str) -> Path:
        made = self.folder / f"{block.rpartition(':')[2]}.fmi3-scalar.fmu"
        return made if made.is_file() else build_block(f"support.sample_units.{block}", 3, self.folder, scalar=True)

    def host(self, block: str, fmi: int, *, event_mode: bool = False, early_return: bool = False) -> CtypesHost:
        """Return a host with an instance of a block's FMU, in a folder that must not be changed."""
        host = _unpacked(self.fmu(block, fmi), fmi).beside()
        self.open.append(host)
        host.instantiate(event_mode=event_mode, early_return=early_return)
        return host

    def own(self, block: str, fmi: int) -> CtypesHost:
        """Return a host without an instance, with a folder of its own."""
        self.open.append(CtypesHost(self.fmu(block, fmi), fmi))
        return self.open[-1]


@functools.cache
def _unpacked(fmu: Path, fmi: int) -> CtypesHost:
    return CtypesHost(fmu, fmi)


def expect_error(wording: Wording, host: CtypesHost, status: int) -> None:
    """Fail unless a call was an error, and its message is the golden file's."""
    assert status == ERROR
    wording.check(host.log[-1])
