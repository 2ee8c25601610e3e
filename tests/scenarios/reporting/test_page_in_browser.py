"""A run's page in a browser: quiet, alone, drawn, in the colours of its reader, on a wide screen and on a phone."""

from pathlib import Path

import pytest
from support.opened_page import opened, overflow, wait_until
from playwright.sync_api import Browser, Page

from handover.cosim.record.reader import Record
from handover.scenarios.ir_grasp.plots import phases_of_grasp

TEXT_COLOURS = "[...document.querySelectorAll('.plot .xtitle')].map(t => getComputedStyle(t).fill)"


def drawn(page: Page) -> list[str]:
    """Return the names of the curves in the explorer's plot."""
    return page.evaluate("document.querySelector('.explorer .plot').data.map(trace => trace.name)")


LOOKS = """(() => {
    const style = getComputedStyle(document.documentElement), names = [0, 1, 2, 3].map(k => `--c${k}`);
    const named = new Map(names.map(name => [style.getPropertyValue(name).trim(), `var(${name})`]));
    return document.querySelector('.explorer .plot').data.map(t => [named.get(t.line.color), t.line.dash]);
})()"""


def looks(page: Page) -> list[list[str]]:
    """Return colour and stroke of the curves in the explorer's plot."""
    return page.evaluate(LOOKS)


@pytest.mark.slow
def test_each_phase_is_named_on_the_page_as_in_the_figure(browser: Browser, grasp: Path):
    phases = phases_of_grasp(Record(grasp / "signals.parquet"))
    with opened(browser, grasp / "report.html") as page:
        names = page.evaluate(
            "document.querySelector('#time .plot').layout.annotations.map(a => [a.text, a.textangle])"
        )
    level, upright = ([name for name, angle in names if bool(angle) is turned] for turned in (False, True))
    assert {p.name for p in phases} == {*level, *upright}
    assert len(set(upright)) == len(upright)
    assert not set(upright) & set(level)
    assert len(names) < len(phases)


def test_the_page_is_drawn_follows_its_reader_and_asks_for_nothing(browser: Browser, grasp: Path):
    with opened(browser, grasp / "report.html") as page:
        assert page.inner_text("h1") == "ir_grasp: succeeded"
        assert page.locator(".plot").count() == page.locator(".plot:has(.main-svg)").count() > 0
        assert page.locator(".modebar-btn").count() > 0
        assert page.locator(".modebar-btn[data-title*=hare], .modebar-btn[data-title*=loud]").count() == 0
        page.fill(".explorer input", "range")
        page.select_option(".explorer select", ["scene.range"])
        wait_until(page, "document.querySelector('.explorer .plot').data[0].name === 'scene.range[1]'")
        assert drawn(page) == [f"scene.range[{i}]" for i in (1, 2, 3)]
        assert page.inner_text(".explorer .about").startswith("scene.range ")
        assert looks(page) == [["var(--c0)", "solid"], ["var(--c1)", "dash"], ["var(--c2)", "dot"]]
        page.fill(".explorer input", "scene.q")
        page.select_option(".explorer select", ["scene.q"])
        wait_until(page, "document.querySelector('.explorer .plot').data[0].name === 'scene.q[1]'")
        strokes, colours = ["solid", "dash", "dot"], [f"var(--c{k})" for k in range(3)]
        assert looks(page)[:9] == [[colours[k // 3], strokes[k % 3]] for k in range(len(looks(page)))][:9]
        light = page.evaluate(TEXT_COLOURS)
        page.emulate_media(color_scheme="dark")
        wait_until(page, f"({TEXT_COLOURS}).every((c, k) => c !== {light}[k])")
        assert overflow(page) <= 0
        page.set_viewport_size({"width": 400, "height": 800})
        wait_until(page, "[...document.querySelectorAll('.plot svg.main-svg')].every(s => s.clientWidth < 400)")
        assert overflow(page) <= 0


@pytest.mark.slow
def test_a_page_opened_on_a_phone_in_the_dark(browser: Browser, grasp: Path):
    with opened(browser, grasp / "report.html", width=400, scheme="dark") as page:
        assert overflow(page) <= 0
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 23, 30)"
