"""How the progress of a campaign is printed."""

import io
import itertools
import threading

import pytest

from handover.scenarios.cli.campaign import CampaignProgress, format_time_left
from handover.scenarios.runs.campaign.worker_pool import RunCounts


@pytest.mark.parametrize(
    ("counts", "elapsed", "text"),
    [
        (RunCounts(total=60), 5.0, ""),
        (RunCounts(total=60, ended=30), 30.0, "30 s left"),
        (RunCounts(total=60, kept=20, ended=30), 30.0, "2 min left"),
        (RunCounts(total=60, ended=5, lost=5), 1200.0, "1.7 h left"),
        (RunCounts(total=60, ended=59), 1.0, "1 s left"),
    ],
)
def test_what_is_left_is_reckoned_from_the_runs_of_this_call(counts: RunCounts, elapsed: float, text: str):
    assert format_time_left(counts, elapsed) == text


def test_a_log_gets_a_line_every_half_minute():
    now, stream = [0.0], io.StringIO()
    with CampaignProgress(stream, lambda: now[0]) as progress:
        for ended in range(11):
            progress(RunCounts(total=10, ended=ended))
            now[0] += 8.0
    assert stream.getvalue().splitlines() == ["4 of 10 runs done, 48 s left", "8 of 10 runs done, 16 s left"]
    assert progress.counts == RunCounts(total=10, ended=10)
    now, stream = [0.0], io.StringIO()
    with CampaignProgress(stream, lambda: now[0]) as progress:
        for now[0] in (30.0, 59.0, 60.0):
            progress.tell()
            progress(RunCounts(total=10))
    assert stream.getvalue().splitlines() == ["starting workers", "0 of 10 runs done"]


def test_nobody_has_to_ask_for_a_line():
    text = threading.Event()

    class Stream(io.StringIO):
        def flush(self) -> None:
            text.set()

    ticks = itertools.count(0.0, 31.0)
    with CampaignProgress(Stream(), lambda: next(ticks)):
        assert text.wait(60)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_gets_a_bar_that_goes_at_the_end(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TERM", "xterm")
    now, stream = [0.0], Terminal()
    with CampaignProgress(stream, lambda: now[0]) as progress:
        progress(RunCounts(total=10))
        now[0] = 5.0
        progress(RunCounts(total=10, ended=5, failed=1))
    assert "5 of 10 runs done, 1 failed" in stream.getvalue()
    assert "5 s left" in stream.getvalue()
    assert stream.getvalue().endswith("\x1b[2K")
