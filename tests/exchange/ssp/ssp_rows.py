"""An exported scenario, and its signals in our own master at one step for all units: what other tools reproduce."""

from fractions import Fraction
from pathlib import Path

from click.testing import CliRunner

from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.scenarios.cli.command import main

SCENARIO = "flyer_impedance"
"""Its units have FMI 2 forms, steps of one length, and no enumerations that would have to be set."""
STEP, STEPS = Fraction(2, 125), 100


def exported(folder: Path) -> Path:
    """Return the SSP of the scenario."""
    file = folder / f"{SCENARIO}.ssp"
    done = CliRunner().invoke(main, ["export", SCENARIO, "--ssp", str(file), "--seed", "3"])
    assert done.exit_code == 0, done.output
    return file


def own_rows(ssp: SspFile) -> list[dict[str, float]]:
    """Return all scalar signals at every communication point, all units stepped in parallel."""
    rows: list[dict[str, float]] = []

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        rows.append({c.name: float(c.values[c.index]) for c in signals.columns()})

    with Master(ssp.system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(STEPS * STEP, [observe])
    return rows
