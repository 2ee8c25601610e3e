"""The live page as HTML, and the message at a run's beginning."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from markupsafe import Markup

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.live_inputs import HandHint
from handover.scenarios.experiment.time_plot import TimePlot
from handover.scenarios.live.shown_run import ShownRun
from handover.scenarios.live.webcam import WEBCAM_SCRIPTS
from handover.scenarios.runs.reporting.html import packed_json
from handover.scenarios.runs.reporting.page import Section, asset, page_html, template
from handover.scenarios.runs.reporting.replay_section import FILM_HTML, SCENE_SCRIPTS, VIEWPORT_HTML
from handover.scenarios.runs.reporting.time_plots import time_figure


def figure_json(plot: TimePlot, time: Floats) -> str:
    """Return a plot over time, s, as the page draws it, in JSON."""
    return packed_json(time_figure(plot, time).to_dict())


def begun_content(shown: ShownRun) -> dict[str, Any]:
    """Return the message at a run's beginning."""
    scene = shown.scene
    assert scene is not None
    surroundings = {name: str(html) for name, html in scene.surroundings().items()}
    pushes = [{"bodies": push.labels, "greatest": push.greatest} for push in shown.pushes]
    content = scene.content() if shown.seat is None else scene.content_for_person()
    facts = {"title": shown.run.title, "scene": content, "signals": list(scene.signals), "pushes": pushes}
    task = "" if shown.seat is None else shown.seat.task
    return {**facts, **surroundings, "hand": shown.seat is not None, "task": task}


def hint_content(hint: HandHint) -> dict[str, Any]:
    """Return what a page gets at an instant, to help who leads a hand; see `HandHint`."""
    goal = None if hint.goal is None else hint.goal.tolist()
    return {**asdict(hint), "p_WH": hint.p_WH.tolist(), "goal": goal}


def live_html(
    title: str,
    beside: Markup | None = None,
    scripts: Sequence[str] = (),
    styles: Sequence[str] = (),
    *,
    webcam: bool = False,
) -> str:
    """Return the page of runs under way, which draws what its connection tells.

    Args:
        title: the heading.
        beside: what stands beside the scene.
        scripts: names of further scripts.
        styles: names of further styles.
        webcam: whether one is offered to lead a hand.
    """
    hand = Markup(template("live/live_hand.html").render(webcam=webcam))
    html = template("live/live.html").render(
        viewport=VIEWPORT_HTML, film=FILM_HTML, hand=hand, beside=beside or Markup()
    )
    sheets = map(asset, ("scene/replay.css", "live/live.css", *styles))
    style = Markup("<style>{}</style>").format(Markup("\n".join(sheets)))
    section = Section(
        anchor="live",
        title="Live",
        html=style + Markup(html),
        scripts=(
            *(*SCENE_SCRIPTS, "phases.js", "scene/side_view.js", "hand/hand_input.js"),
            *(WEBCAM_SCRIPTS if webcam else ()),
            *("live/live_hand.js", "live/hand_hints.js", "live/live.js", "live/push.js", *scripts),
        ),
    )
    return page_html(title, Markup(""), [section], connects=True, works=webcam)
