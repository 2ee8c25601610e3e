"""Messages are compared with a golden file, in order, without the test's own folder."""

from pathlib import Path

import pytest

from support.wording import Wording


def test_a_message_is_the_golden_files(wording: Wording, tmp_path: Path):
    wording.check(FileNotFoundError(f"{tmp_path}/a is not there"))
    wording.check("of two lines,\n\n  one after an empty one")


def test_another_message_and_one_more_than_it_has_are_found(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("HANDOVER_REWRITE_WORDING", raising=False)
    of_this_file = "tests/support/test_wording.py::test_a_message_is_the_golden_files"
    compared = Wording(of_this_file, None)
    with pytest.raises(AssertionError, match="make wording"):
        compared.check("another")
    compared.check("of two lines,\n\n  one after an empty one")
    with pytest.raises(AssertionError, match="make wording"):
        compared.check("one more")
