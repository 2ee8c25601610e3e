import pytest
from support.forked_probes import ForkedProbes


@pytest.fixture(autouse=True)
def in_forked_processes(probes: ForkedProbes) -> None:
    """All checks here."""
