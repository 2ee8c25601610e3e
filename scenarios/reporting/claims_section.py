"""What became of a paper's claims, and its values beside the campaign's."""

from collections.abc import Sequence

from markupsafe import Markup

from scenarios.published.claim import Claim, Verdict
from scenarios.published.comparison_table import ComparisonTable
from scenarios.reporting.rows_table import rows_table
from scenarios.reporting.section import Section

_COLOURS = {Verdict.REPRODUCED: "good", Verdict.NOT_REPRODUCED: "bad", Verdict.NOT_COMPARABLE: "soft"}


def claims_section(claims: Sequence[Claim]) -> Section | None:
    """Return the table of claims with their verdicts, this project's own below; None if there are none."""
    parts: list[Markup] = []
    for beyond, caption in ((False, ""), (True, "Beyond the paper")):
        rows = [_row(c) for c in claims if c.beyond is beyond]
        if rows:
            parts.append(rows_table(("claim", "published", "ours", "95 % interval", "verdict"), rows, caption=caption))
    return Section(anchor="claims", title="Claims", html=Markup("\n").join(parts)) if parts else None


def verdict_html(verdict: Verdict) -> Markup:
    """Return a verdict in its colour."""
    return Markup("<b class='{}'>{}</b>").format(_COLOURS[verdict], verdict.value)


def _row(claim: Claim) -> tuple[str | Markup, ...]:
    where = Markup("<br><span class='soft'>{}</span>").format(claim.where) if claim.where else Markup()
    reason = Markup("<div class='prose'>{}<br><span class='soft'>{}</span></div>").format(
        verdict_html(claim.verdict), claim.reason
    )
    return (
        Markup("<div class='prose'>{}{}</div>").format(claim.claim, where),
        claim.published,
        claim.measured,
        _span(claim),
        reason,
    )


def _span(claim: Claim) -> str:
    if claim.interval is None:
        return "–"
    low, high = claim.interval
    return f"{low:.3g} to {high:.3g}" + ("" if claim.unit == "1" else f" {claim.unit}")


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
