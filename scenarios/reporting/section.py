"""A part of a page."""

from dataclasses import dataclass

from markupsafe import Markup


@dataclass(frozen=True, kw_only=True)
class Section:
    """A heading and what stands below it.

    Attributes:
        anchor: its name in links, such as "replay".
        title: the heading.
        html: what stands below.
        scripts: names of files in `scenarios/reporting/page/` that it needs, without `page.js`, which is always there.
    """

    anchor: str
    title: str
    html: Markup
    scripts: tuple[str, ...] = ()
