"""A call that does not return is abandoned after its timeout."""

import threading
from collections.abc import Generator

import pytest

from handover.scenarios.campaign.cluster import call_with_timeout


@pytest.fixture
def never() -> Generator[threading.Event, None, None]:
    """An event that is not set until the end of the test."""
    event = threading.Event()
    yield event
    event.set()


def test_it_is_called_in_another_thread():
    assert call_with_timeout(threading.get_ident, 60.0) != threading.get_ident()


def test_what_it_raises_is_raised_in_the_caller():
    def ask() -> None:
        raise ValueError("no such worker")

    with pytest.raises(ValueError, match="no such worker"):
        call_with_timeout(ask, 60.0)


def test_a_call_without_an_answer_times_out(never: threading.Event):
    with pytest.raises(TimeoutError, match=r"^no answer within 0\.1 s$"):
        call_with_timeout(lambda: never.wait(60.0), 0.1)
