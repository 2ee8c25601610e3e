import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # reference, drive, player

from reference import References


@pytest.fixture(scope="session")
def references(tmp_path_factory: pytest.TempPathFactory) -> References:
    return References(tmp_path_factory.mktemp("players"))
