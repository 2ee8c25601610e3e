import os
import tempfile
from pathlib import Path

import pytest

from handover.cosim.files import scratch_folder


@pytest.mark.skipif(os.name == "nt", reason="needs fork and locks")
def test_what_a_killed_process_left_is_removed_and_what_is_in_use_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "handover-of-somebody").mkdir()
    with scratch_folder("units") as used:
        child = os.fork()
        if child == 0:
            scratch = scratch_folder("units")
            (scratch.__enter__() / "unit.so").touch()
            os._exit(0)
        os.waitpid(child, 0)
        assert len(list(tmp_path.glob("*/unit.so"))) == 1
        with scratch_folder("check") as later:
            assert {used, later} == {*tmp_path.glob("handover-scratch-*")}
    assert [p.name for p in tmp_path.iterdir()] == ["handover-of-somebody"]
