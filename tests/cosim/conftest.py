import zipfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import decay
import pytest
from driven_unit import DrivenUnit, Started
from fmu_of import FmuOf
from native_units import Edited, native_fmu

from handover.fmus.build import build_block


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> FmuOf:
    """Build an FMU of one of master_blocks, once a session."""
    folder = tmp_path_factory.mktemp("blocks")
    made: dict[tuple[str, int], Path] = {}

    def build(block: str, fmi: int = 3) -> Path:
        if (block, fmi) not in made:
            made[block, fmi] = build_block(f"master_blocks:{block}", fmi, folder, step=Fraction(1, 10))
        return made[block, fmi]

    return build


@pytest.fixture(scope="session")
def decay_library(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Compile the foreign unit of decay.c."""
    return decay.compiled(tmp_path_factory.mktemp("decay"))


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    """Start native units without the master; free them at the end."""
    made: list[DrivenUnit] = []

    def start(name: str, fmi: int, *, event_mode: bool = False, **values: float) -> DrivenUnit:
        unit = DrivenUnit(name, fmi, tmp_path / f"unit_{len(made)}")
        made.append(unit)
        unit.start(event_mode=event_mode, **values)
        return unit

    yield start
    for unit in made:
        unit.fmu.freeInstance()


@pytest.fixture
def edited(tmp_path: Path) -> Edited:
    """Return a native unit's FMU with texts of its description replaced, each of which must be there."""

    def edit(unit: str, fmi: int, *edits: tuple[str, str]) -> Path:
        file = tmp_path / f"{unit}-{fmi}.fmu"
        with zipfile.ZipFile(native_fmu(unit, fmi)) as sound, zipfile.ZipFile(file, "w") as faulty:
            for name in sound.namelist():
                content = sound.read(name)
                for old, new in edits if name.endswith(".xml") else ():
                    assert old.encode() in content, old
                    content = content.replace(old.encode(), new.encode())
                faulty.writestr(name, content)
        return file

    return edit
