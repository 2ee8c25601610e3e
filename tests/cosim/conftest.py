from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim import decay
from support.cosim.fmu_of import FmuOf
from support.cosim.native_units import Edited, native_fmu
from support.forked_probes import ForkedProbes, forked_probes
from support.rewritten_archive import rewritten

from handover.fmus.build import build_block


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> FmuOf:
    """Build an FMU of one of master_blocks, once a session."""
    folder = tmp_path_factory.mktemp("blocks")
    made: dict[tuple[str, int], Path] = {}

    def build(block: str, fmi: int = 3) -> Path:
        if (block, fmi) not in made:
            made[block, fmi] = build_block(f"support.cosim.master_blocks:{block}", fmi, folder, step=Fraction(1, 10))
        return made[block, fmi]

    return build


@pytest.fixture(scope="session")
def decay_library(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Compile the foreign unit of decay.c."""
    return decay.compiled(tmp_path_factory.mktemp("decay"))


@pytest.fixture
def edited(tmp_path: Path) -> Edited:
    """Return a native unit's FMU with texts of its description replaced, each of which must be there."""

    def edit(unit: str, fmi: int, *edits: tuple[str, str]) -> Path:
        file = tmp_path / f"{unit}-{fmi}.fmu"

        def rewrite(name: str, content: bytes) -> bytes:
            for old, new in edits if name.endswith(".xml") else ():
                assert old.encode() in content, old
                content = content.replace(old.encode(), new.encode())
            return content

        return rewritten(native_fmu(unit, fmi), file, rewrite)

    return edit


@pytest.fixture
def probes() -> Iterator[ForkedProbes]:
    """Checks fork their processes."""
    with forked_probes() as probes:
        yield probes
