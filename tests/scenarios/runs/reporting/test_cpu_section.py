"""CPU time by unit: shares, time a step, and what the master took."""

from typing import Any

from handover.scenarios.runs.reporting.run_page import cpu_section


def unit(name: str, seconds: float | None, steps: int | None = 100) -> dict[str, Any]:
    return {"name": name, "model": "M (FMI 3)", "step": "10 ms", "steps": steps, "cpu_seconds": seconds}


def html_of(units: list[dict[str, Any]], cpu: float) -> str:
    section = cpu_section({"units": units, "cpu_seconds": cpu, "simulated_seconds": 20.0})
    assert section is not None
    return str(section.html)


def test_what_no_unit_took_is_the_masters():
    html = html_of([unit("hand", 1.0), unit("camera", 6.0, 40)], 10.0)
    assert "2 simulated seconds a CPU second" in html
    assert "camera 6 s, 60 %; hand 1 s, 10 %; master, recording and other 3 s, 30 %" in html
    assert '<td class="number">150 ms</td><td class="number">6 s</td><td class="number">60 %</td>' in html
    assert '<td colspan="5">master, recording and other</td><td class="number">3 s</td>' in html


def test_small_shares_have_a_digit_more_and_the_cheapest_of_many_units_share_a_bar_but_not_a_row():
    html = html_of([unit("a", 9.99), unit("b", 0.05, 0)], 10.0)
    assert '<td class="number">0.5 %</td>' in html
    assert '<td class="number">–</td>' in html
    assert "other 0 s, 0.0 %" in html, "shares are never above the whole"
    html = html_of([unit(f"u{i}", 1.0 + i) for i in range(30)], 600.0)
    assert "6 other units" in html
    assert html.count("M (FMI 3)") == 30


def test_of_a_run_that_crashed_nothing_is_known():
    assert cpu_section({"units": [unit("a", None, None)], "cpu_seconds": 3.0, "simulated_seconds": 1.0}) is None
    assert cpu_section({}) is None
