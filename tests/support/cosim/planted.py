"""A pickle that shows whether anybody has unpickled it: that makes a file."""

import pickle
from pathlib import Path


class CodeThatRuns:
    """What runs code where it is unpickled."""

    def __init__(self, code: str) -> None:
        self._code = code

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, (self._code,)


def planted_pickle(folder: Path) -> tuple[bytes, Path]:
    """Return a pickle, and the file that appears once it is unpickled."""
    mark = folder / "unpickled"
    packed = pickle.dumps(CodeThatRuns(f"open({str(mark)!r}, 'w').close()"))
    return packed, mark
