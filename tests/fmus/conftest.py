from collections.abc import Iterator
from pathlib import Path

import pytest
from support.fmus.workshop import Workshop


@pytest.fixture(scope="session")
def fmu_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture
def workshop(fmu_folder: Path) -> Iterator[Workshop]:
    made = Workshop(fmu_folder)
    yield made
    for host in made.open:
        host.close()
