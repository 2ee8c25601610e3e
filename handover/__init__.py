"""Robots that hand objects over, as Functional Mock-up Units, and the master that co-simulates them.

What this module exports is the public interface, by which programs and notebooks run, sweep, step and look at results:

    import handover

    run = handover.run("ir_grasp", seed=3, strategy="reflex")
    print(run.success, run.reason, run.metrics["moved"])
    run.plot("scene.p_WH").savefig("hand.png")

Each name is loaded when it is first used, so that `import handover` takes next to no time. All that is below may move:
`handover.cosim` is the engine; `handover.plants` and `handover.controllers` have the robots' models and controllers;
`handover.fmus` makes units of them; `handover.scenarios` has the experiments and the command line.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handover.cosim.exceptions import RecordNotWritten, UnitFailure
    from handover.cosim.fmu.file.description import FmuDescription
    from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
    from handover.cosim.system.system import System
    from handover.scenarios.api.arguments import InvalidInput
    from handover.scenarios.api.campaign_result import Campaign
    from handover.scenarios.api.catalog import describe, load, system, unit
    from handover.scenarios.api.pages import Page
    from handover.scenarios.api.run_result import Quantity, Run
    from handover.scenarios.api.running import environment, run
    from handover.scenarios.api.session import SavedState, Session, open  # noqa: A004
    from handover.scenarios.api.signals import SignalTable
    from handover.scenarios.api.sweeping import sweep
    from handover.scenarios.runs.execution.errors import ClusterLost

_EXPORTS = {
    "AdaptiveStep": "cosim.stepping.options",
    "Algorithm": "cosim.stepping.options",
    "Campaign": "scenarios.api.campaign_result",
    "ClusterLost": "scenarios.runs.execution.errors",
    "Extrapolation": "cosim.stepping.options",
    "FmuDescription": "cosim.fmu.file.description",
    "InvalidInput": "scenarios.api.arguments",
    "MasterOptions": "cosim.stepping.options",
    "Page": "scenarios.api.pages",
    "Quantity": "scenarios.api.run_result",
    "RecordNotWritten": "cosim.exceptions",
    "Run": "scenarios.api.run_result",
    "SavedState": "scenarios.api.session",
    "Session": "scenarios.api.session",
    "SignalTable": "scenarios.api.signals",
    "System": "cosim.system.system",
    "UnitFailure": "cosim.exceptions",
    "describe": "scenarios.api.catalog",
    "environment": "scenarios.api.running",
    "load": "scenarios.api.catalog",
    "open": "scenarios.api.session",
    "run": "scenarios.api.running",
    "sweep": "scenarios.api.sweeping",
    "system": "scenarios.api.catalog",
    "unit": "scenarios.api.catalog",
}
"""The module, below this package, that each exported name is loaded from."""

__all__ = [
    "AdaptiveStep",
    "Algorithm",
    "Campaign",
    "ClusterLost",
    "Extrapolation",
    "FmuDescription",
    "InvalidInput",
    "MasterOptions",
    "Page",
    "Quantity",
    "RecordNotWritten",
    "Run",
    "SavedState",
    "Session",
    "SignalTable",
    "System",
    "UnitFailure",
    "describe",
    "environment",
    "load",
    "open",
    "run",
    "sweep",
    "system",
    "unit",
]


def __getattr__(name: str) -> Any:
    """Return an exported name, loading it."""
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f"{__name__}.{_EXPORTS[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the names that are exported, with those that are loaded."""
    return sorted({*globals(), *__all__})
