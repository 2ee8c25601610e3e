"""The record of a run, written so that it outlives the process, and read back."""

from typing import TYPE_CHECKING

from handover.cosim.record.reader import Record

if TYPE_CHECKING:
    from handover.cosim.record.recorder import Recorder

__all__ = ["Record", "Recorder"]


def __getattr__(name: str) -> object:
    """Load `Recorder`, and with it Arrow, only for who records: a record's reader is in every scenario."""
    if name != "Recorder":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from handover.cosim.record.recorder import Recorder

    return Recorder
