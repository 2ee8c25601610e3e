from pathlib import Path

import pytest
from support.scenarios.tutorial import write_files


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder that has nothing but the tutorial's files."""
    folder = tmp_path / "mine"
    folder.mkdir()
    write_files(folder)
    return folder
