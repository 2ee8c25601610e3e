"""The published experiments by name."""

from collections.abc import Mapping

from handover.scenarios.published.free_flyer.flyer_approaches import FlyerApproaches
from handover.scenarios.published.free_flyer.flyer_controllers import FlyerControllers
from handover.scenarios.published.free_flyer.flyer_handover import FlyerHandoverTable
from handover.scenarios.published.free_flyer.flyer_impedance import FlyerImpedanceTable
from handover.scenarios.published.free_flyer.flyer_navigation import FlyerNavigation
from handover.scenarios.published.free_flyer.flyer_stability import FlyerStability
from handover.scenarios.published.free_flyer.flyer_study import FlyerStudy
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.helix.helix_2 import Helix2
from handover.scenarios.published.helix.helix_3 import Helix3
from handover.scenarios.published.helix.helix_disturbances import HelixDisturbances
from handover.scenarios.published.helix.helix_improvements import HelixImprovements
from handover.scenarios.published.helix.helix_places import HelixPlaces
from handover.scenarios.published.helix.helix_reflex import HelixReflex
from handover.scenarios.published.helix.helix_workspace import HelixWorkspace
from handover.scenarios.published.ir_grasp.ir_convergence import IrConvergence
from handover.scenarios.published.ir_grasp.ir_limits import IrLimits
from handover.scenarios.published.ir_grasp.ir_sensor import IrSensorCurve
from handover.scenarios.published.ir_grasp.ir_table import IrTable
from handover.scenarios.published.published_experiment import PublishedExperiment
from handover.scenarios.published.vsl.vsl_1 import Vsl1
from handover.scenarios.published.vsl.vsl_2 import Vsl2

_ALL: tuple[type[PublishedExperiment], ...] = (
    FlyerApproaches,
    FlyerControllers,
    FlyerHandoverTable,
    FlyerImpedanceTable,
    FlyerNavigation,
    FlyerStability,
    FlyerStudy,
    Helix1,
    Helix2,
    Helix3,
    HelixDisturbances,
    HelixImprovements,
    HelixPlaces,
    HelixReflex,
    HelixWorkspace,
    IrConvergence,
    IrLimits,
    IrSensorCurve,
    IrTable,
    Vsl1,
    Vsl2,
)

EXPERIMENTS: Mapping[str, type[PublishedExperiment]] = {e.name: e for e in _ALL}
