"""Help with headings: every option once, arguments not among them."""

from click.testing import CliRunner

from handover.scenarios.cli.command import main
from handover.scenarios.cli.run import run


def test_help_of_a_run_has_every_option_once_below_its_heading():
    output = CliRunner().invoke(main, ["run", "--help"], terminal_width=200).output
    rows = [line.split()[0].rstrip(",") for line in output.splitlines() if line.startswith("  -")]
    assert sorted(rows) == sorted(
        ["-h", *(p.opts[0] for p in run.params if p.opts[0].startswith("-") and p.opts[0] not in ("-h", "--controls"))]
    )
    headings = [line for line in output.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert headings == [
        "Options:",
        "Of FILE.ssp and FILE.fmu:",
        "Record:",
        "Coupling of units:",
        "Length of steps:",
        "Wall time:",
    ]
    assert output.index("Length of steps:") < output.index("--largest-step") < output.index("Wall time:")
