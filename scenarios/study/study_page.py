"""The page of a study: one file with its scripts, its style and its words inside."""

from importlib import resources
from typing import Any

import tomli

from handover.scenarios.reporting.html import json_html
from handover.scenarios.reporting.page import asset, plain_page_html, template
from handover.scenarios.reporting.replay_section import SCENE_SCRIPTS
from handover.scenarios.study.codebook import PILOT
from handover.scenarios.study.plan import StudyPlan

_SCRIPTS = ("page.js", *SCENE_SCRIPTS, "hand_input.js", "study_scene.js", "study.js")
_FALLBACK = "en"


def page_words() -> dict[str, dict[str, Any]]:
    """Return the words of the page's own buttons and lines, by language."""
    text = resources.files("handover.scenarios.study").joinpath("page_words.toml").read_text(encoding="utf-8")
    return tomli.loads(text)


def study_html(plan: StudyPlan) -> str:
    """Return the page; in a language that it has no words of its own for, buttons are in English."""
    words = page_words()
    content = {
        "words": {name: {**words[_FALLBACK], **words.get(name, {})} for name in plan.texts},
        "pilot": PILOT if plan.pilot else "",
    }
    html = template("study.html").render(data=json_html(content), pilot=PILOT.capitalize() if plan.pilot else "")
    return plain_page_html(plan.title, html, (asset("page.css"), asset("replay.css"), asset("study.css")), _SCRIPTS)
