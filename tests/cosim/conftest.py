import sys
from fractions import Fraction
from pathlib import Path

import pytest

from fmus.build import build_block

sys.path.insert(0, str(Path(__file__).parent))  # master_blocks, decay, fmu_of

import decay
from fmu_of import FmuOf


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
