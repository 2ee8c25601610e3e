"""The record in a run's folder, as pages and figures need it."""

from handover.cosim.exceptions import one_line
from handover.cosim.record.reader import Record
from handover.scenarios.run_folder import BadRunFolder, RunFolder


def record_of(folder: RunFolder) -> Record | None:
    """Return a run's record; None where there is none, or one of less than two rows, which shows nothing over time.

    Raises:
        BadRunFolder: it is damaged.
    """
    if not folder.signals.exists():
        return None
    try:
        record = Record(folder.signals)
        return record if len(record.time) > 1 else None
    except (OSError, ValueError, KeyError) as e:  # Arrow's faults are among them
        raise BadRunFolder(folder.path, f"its {folder.signals.name} is damaged: {one_line(e)}") from e
