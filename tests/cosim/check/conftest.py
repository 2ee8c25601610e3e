from collections.abc import Iterator
from functools import cache
from unittest.mock import patch

import lark
import pytest
from support.forked_probes import ForkedProbes, forked_probes

_lark = cache(lark.Lark)


@pytest.fixture(autouse=True)
def probes() -> Iterator[ForkedProbes]:
    """Checks fork their processes, and FMPy makes its grammar of names once: both would take longer than the rest."""
    with forked_probes() as probes, patch("lark.Lark", _lark):
        yield probes
