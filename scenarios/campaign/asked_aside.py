"""Waiting, for a while, for who may never answer."""

import queue
import threading
from collections.abc import Callable
from typing import TypeVar

_Answer = TypeVar("_Answer")


def asked_aside(ask: Callable[[], _Answer], bound: float) -> _Answer:
    """Return what a function returns that is called in a thread of its own.

    So it may run an event loop where the caller's thread has one already, as in a notebook.

    Args:
        ask: asks and waits for the answer.
        bound: how long it gets, s; after that it is left alone.

    Raises:
        TimeoutError: it has not returned in time. What it raises itself, besides.
    """
    told: queue.SimpleQueue[tuple[_Answer] | Exception] = queue.SimpleQueue()

    def wait() -> None:
        try:
            told.put((ask(),))
        except Exception as e:  # raised where it is waited for
            told.put(e)

    threading.Thread(target=wait, daemon=True).start()
    try:
        answer = told.get(timeout=bound)
    except queue.Empty:
        raise TimeoutError(f"no answer within {bound:g} s") from None
    if isinstance(answer, Exception):
        raise answer
    return answer[0]
