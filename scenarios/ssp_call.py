"""What a call of `handover run` says of an SSP: until when, and at which step."""

import contextlib
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click

from handover.cosim.ssp.ssp_file import SspFile
from handover.scenarios import supervisor
from handover.scenarios.bad_call import BadCall
from handover.scenarios.experiment import Experiment
from handover.scenarios.headed_options import HeadedOption
from handover.scenarios.run_folder import sha256_of
from handover.scenarios.seconds import Seconds
from handover.scenarios.ssp_run import UntilStop, experiment_of

_option = partial(click.option, cls=HeadedOption, heading="Of FILE.ssp", type=Seconds(), metavar="SECONDS")
_STOP = _option(
    "--stop",
    help="When the run ends: at the first communication point at or after it.  [default: the file's own stop time]",
)
_STEP = _option("--step", help="Communication step of all units.  [default: what each FMU proposes]")


def ssp_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--stop` and `--step`, which are for SSPs."""
    return _STOP(_STEP(command))


def refuse_for_ssp(**given: Any) -> None:
    """Refuse options that are for scenarios.

    Raises:
        BadCall: one of them is given.
    """
    used = [name for name, value in given.items() if value]
    if used:
        raise BadCall(f"{', '.join(used)}: for scenarios; an SSP has its parameters and units inside")


def open_experiment(
    path: Path, stop: Fraction | None, step: Fraction | None, opened: contextlib.ExitStack
) -> Experiment[UntilStop]:
    """Open an SSP as an experiment; `opened` closes it.

    Raises:
        InvalidSsp: see `SspFile`. BadCall: neither the file nor the call says when it ends.
    """
    ssp = opened.enter_context(SspFile(path, step))
    supervisor.heartbeat.tell_scratch(str(ssp.folder))
    until = stop or ssp.stop
    if until is None:
        raise BadCall(f"{path}: its description has no stop time; --stop 10 lets it run for 10 s")
    return experiment_of(ssp, until)


def source_of(path: Path, stop: Fraction, step: Fraction | None) -> dict[str, Any]:
    """Return what a run's folder says of an SSP, so that the run can go on: the file, and what was chosen of it."""
    told = {"stop": str(stop), "step": None if step is None else str(step)}
    return {"ssp": str(path.absolute()), "sha256": sha256_of(path), **told}
