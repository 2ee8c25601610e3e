"""The arm follows a path by rigid-link kinematics with learned corrections. [Gandarias2020] sec. V-B, experiment 2."""

from pathlib import Path
from typing import Any, ClassVar

from handover.scenarios.vsl.parameters import HybridParameters
from handover.scenarios.vsl.path_experiment import PathExperiment


class VslHybrid(PathExperiment):
    """The paper's second experiment: pressures and currents tell how far the links bend."""

    name: ClassVar[str] = "vsl_hybrid"
    title: ClassVar[str] = "an arm of soft links follows a path by kinematics with learned corrections"
    parameters_type: ClassVar[type[HybridParameters]] = HybridParameters
    hybrid: ClassVar[bool] = True

    def kinematics(self, parameters: HybridParameters) -> dict[str, Any]:
        """Return the trained model's file, absolute, since a unit may run in another folder."""
        return {"model": str(Path(parameters.model).absolute()) if parameters.model else ""}
