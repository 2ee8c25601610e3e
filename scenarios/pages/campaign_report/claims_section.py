"""A paper's claims with their verdicts, and published values beside ours."""

from collections.abc import Sequence

from markupsafe import Markup

from handover.scenarios.published.published_experiment import Claim, ComparisonTable, Verdict
from handover.scenarios.runs.reporting.html import rows_table
from handover.scenarios.runs.reporting.page import Section

_HEADER = ("claim", "published", "ours", "95 % interval", "verdict")
_HEADER_BEYOND = tuple(name for name in _HEADER if name != "published")
_COLOURS = {Verdict.REPRODUCED: "good", Verdict.NOT_REPRODUCED: "bad", Verdict.NOT_COMPARABLE: "soft"}


def claims_section(claims: Sequence[Claim]) -> Section | None:
    """Return the table of claims with their verdicts, this project's own below; None if there are none."""
    parts: list[Markup] = []
    for beyond, title, header in ((False, "", _HEADER), (True, "Beyond the paper", _HEADER_BEYOND)):
        rows = [_rows(c, header) for c in claims if c.beyond is beyond]
        if rows:
            heads = Markup().join(Markup("<th scope='col'>{}</th>").format(h) for h in header)
            heading = Markup("<h3>{}</h3>").format(title) if title else Markup()
            table = Markup("<table class='cards claims'><thead><tr>{}</tr></thead><tbody>\n{}\n</tbody></table>")
            parts.append(heading + table.format(heads, Markup("\n").join(rows)))
    return Section(anchor="claims", title="Claims", html=Markup("\n").join(parts)) if parts else None


def verdict_html(verdict: Verdict, words: str) -> Markup:
    """Return the words of a verdict in its colour."""
    return Markup("<b class='{}'>{}</b>").format(_COLOURS[verdict], words)


def _rows(claim: Claim, header: Sequence[str]) -> Markup:
    where = Markup("<br><span class='soft'>{}</span>").format(claim.where) if claim.where else Markup()
    verdict = verdict_html(claim.verdict, claim.verdict_text)
    cells = {
        "claim": Markup("{}{}").format(claim.claim, where),
        "published": claim.published,
        "ours": claim.measured,
        "95 % interval": claim.interval_text,
        "verdict": verdict,
    }
    text = Markup().join(
        Markup("<td data-label='{}'{}>{}</td>").format(
            name, Markup() if cells[name] else Markup(" class='empty'"), cells[name]
        )
        for name in header
    )
    why = Markup("<tr class='why'><td colspan='{}'>{}</td></tr>").format(len(header), claim.reason)
    return Markup("<tr>{}</tr>").format(text) + why


def comparison_section(tables: Sequence[ComparisonTable]) -> Section | None:
    """Return published values beside ours; None if there are none."""
    note = Markup("<p class='soft'>{}</p>")
    parts = [
        Markup("<h3>{}</h3>").format(t.title)
        + rows_table(t.header, t.rows)
        + (note.format(t.note) if t.note else Markup())
        for t in tables
    ]
    if not parts:
        return None
    return Section(anchor="comparison", title="Published and ours", html=Markup("\n").join(parts))
