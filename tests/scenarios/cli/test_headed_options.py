"""Help with headings: every option once."""

from support.commands import call

from handover.scenarios.cli.run import run


def test_help_of_a_run_has_every_option_once_below_its_heading():
    output = call("run", "--help").output
    rows = [line.split()[0].rstrip(",") for line in output.splitlines() if line.startswith("  -")]
    options = {p.opts[0] for p in run.params if p.opts[0].startswith("-")} - {"--controls"}
    assert sorted(rows) == sorted({"-h", *options})
    order = [
        output.index(text) for text in ("Options:", "Coupling", "Length of steps:", "--largest-step", "Wall time:")
    ]
    assert order == sorted(order)
