import os
from collections.abc import Callable
from pathlib import Path

import pytest
from support.cosim import native_units
from support.exchange import ecos_command
from support.processes import with_path

HERE = Path(__file__).parent
NativeFmu = Callable[..., Path]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All here is of one tier, `make bench`."""
    for item in items:
        if item.path.is_relative_to(HERE):
            item.add_marker("bench")


@pytest.fixture(scope="session")
def native_fmu() -> NativeFmu:
    """Builds native test units: `native_units.native_fmu`."""
    return native_units.native_fmu


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which Ecos finds what it needs."""
    ecos = ecos_command.Ecos(tmp_path_factory.mktemp("ecos")).environment
    return {**with_path(), **ecos, "PATH": f"{os.environ['PATH']}{os.pathsep}{ecos['PATH']}"}
