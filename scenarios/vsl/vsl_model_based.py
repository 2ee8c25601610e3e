"""The arm follows a path by rigid-link kinematics. [Gandarias2020] sec. V-A, experiment 1."""

from typing import ClassVar

from handover.scenarios.vsl.parameters import Parameters
from handover.scenarios.vsl.path_experiment import PathExperiment


class VslModelBased(PathExperiment):
    """The paper's first experiment: links bend, and the kinematics do not know."""

    name: ClassVar[str] = "vsl_model_based"
    title: ClassVar[str] = "an arm of soft links follows a path by rigid-link kinematics"
    parameters_type: ClassVar[type[Parameters]] = Parameters
    hybrid: ClassVar[bool] = False
