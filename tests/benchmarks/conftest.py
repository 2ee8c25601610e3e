import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
NativeFmu = Callable[..., Path]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """All here is of one tier, `make bench`."""
    for item in items:
        if item.path.is_relative_to(HERE):
            item.add_marker("bench")


def module(folder: str, name: str) -> Any:
    """Import a module of another folder of tests."""
    sys.path.insert(0, str(HERE.parent / folder))
    return importlib.import_module(name)


@pytest.fixture(scope="session")
def native_fmu() -> NativeFmu:
    """Builds native test units: `native_units.native_fmu`."""
    return module("cosim", "native_units").native_fmu


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which Ecos finds what it needs."""
    ecos = module("exchange", "ecos_command").Ecos(tmp_path_factory.mktemp("ecos")).environment
    return {**os.environ, **ecos, "PATH": f"{os.environ['PATH']}{os.pathsep}{ecos['PATH']}"}


@pytest.fixture(scope="session")
def wait_until() -> Callable[..., None]:
    """Waits for a page in a browser: `opened_page.wait_until`."""
    return module("support", "opened_page").wait_until
