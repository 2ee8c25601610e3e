"""Messages as one golden file has them, `tests/wording.txt`, so that tests of errors are by type and data.

`make wording` writes the file anew; whoever reads the difference judges the sentences.
"""

import os
import re
from collections import defaultdict
from functools import cache
from pathlib import Path
from textwrap import indent

import pytest

_FILE = Path(__file__).parent.parent / "wording.txt"
_REWRITES = "HANDOVER_REWRITE_WORDING"
_noted: dict[str, list[str]] = defaultdict(list)


class Wording:
    """What a test's messages should say: those in the golden file under the test's name, in order."""

    def __init__(self, test: str, folder: Path | None) -> None:
        self._test, self._folder = test, folder
        self._messages = _golden().get(test, [])
        self._count = 0

    def check(self, message: object) -> None:
        """Compare a message, or an error's, with the golden file; the test's own folder is written as TMP."""
        text = "\n".join(line.rstrip() for line in str(message).strip().splitlines())
        if self._folder is not None:
            text = text.replace(str(self._folder), "TMP")
        if os.environ.get(_REWRITES):
            _noted[self._test].append(text)
            return
        wanted = self._messages[self._count] if self._count < len(self._messages) else None
        self._count += 1
        assert text == wanted, "the message is not the golden file's; if it is better, run `make wording`"


def write_golden(collected: "set[str]", deselected: "set[str]") -> None:
    """Write what was noted in place of what the file has of the same files' tests, if these were not deselected."""
    if not os.environ.get(_REWRITES):
        return
    files = {test.partition("::")[0] for test in collected}
    kept = {t: said for t, said in _golden().items() if t in deselected or t.partition("::")[0] not in files}
    blocks = [
        f"== {test}\n" + "\n--\n".join(indent(message, "  ") for message in messages)
        for test, messages in sorted({**kept, **_noted}.items())
    ]
    _FILE.write_text("\n\n".join(blocks) + "\n", encoding="utf-8")


@cache
def _golden() -> dict[str, list[str]]:
    if not _FILE.is_file():
        return {}
    found: dict[str, list[str]] = {}
    for block in re.split(r"^== ", _FILE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
        test, _, body = block.partition("\n")
        messages = re.split(r"^--\n", body.rstrip("\n") + "\n", flags=re.MULTILINE)
        found[test] = ["\n".join(line.removeprefix("  ") for line in m.rstrip("\n").split("\n")) for m in messages]
    return found


@pytest.fixture
def wording(request: pytest.FixtureRequest) -> Wording:
    """Compares messages with the golden file."""
    folder = request.getfixturevalue("tmp_path") if "tmp_path" in request.fixturenames else None
    return Wording(request.node.nodeid, folder)
