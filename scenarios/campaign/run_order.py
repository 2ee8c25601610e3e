"""One run of a campaign as a worker gets it, and what it answers."""

from collections.abc import Mapping
from dataclasses import dataclass

from handover.cosim.stepping.options import MasterOptions


@dataclass(frozen=True, kw_only=True)
class RunOrder:
    """What a worker needs to carry out a run. It can be pickled; paths are absolute and seen by all workers alike.

    Attributes:
        name: of the run's folder in `runs`. While it runs, its files are in a folder of another name beside it, which
            is given this name when the run has ended, so that what bears the name is complete.
        scenario, parameters, seed: what to run; parameters are texts `name=value`.
        fmus: the FMU of each unit.
        runs: the campaign's folder of runs.
        options: how units are run.
    """

    name: str
    scenario: str
    parameters: tuple[str, ...]
    seed: int
    fmus: Mapping[str, str]
    runs: str
    options: MasterOptions


@dataclass(frozen=True, kw_only=True)
class RunAnswer:
    """How a worker did with an order.

    Attributes:
        name: the order's.
        lost: why there is no folder of the run, in a sentence; "" if there is one, whose `summary.json` tells the rest.
        no_room: what the system says if a full disk is why it is lost, as "No space left on device"; else "".
    """

    name: str
    lost: str = ""
    no_room: str = ""
