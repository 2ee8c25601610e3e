"""What a unit needs to take a place in the scenarios of the arm with links of variable stiffness."""

from collections.abc import Mapping, Sequence

from handover.controllers.vsl.hybrid_kinematics import Imu
from handover.cosim.system.system import System
from handover.scenarios.experiment.places import Place

_WORLD = (
    "W is the world: z points up, and the first joint turns about it; the ground is at z = 0. "
    "Vectors are in W, and values of joints begin with joint 1."
)
_Q_REF = {"q_ref": "", "qd_ref": ""}

PLACES = {
    "planner": Place(
        required={
            **_Q_REF,
            "p_cmd": "",
            "p_WG_goal": "errors are those of the tip from it",
            "segment": "shown over time",
            "moving": "a point of the path counts as it is left while this is true",
            "done": "by it the run ends",
        },
        optional={"pressure": "the scenario's parameter"},
        remarks=(_WORLD,),
    ),
    "kinematics": Place(
        required={"q_cmd": "", "qd_cmd": "0 is as fast as they can"},
        optional={
            **_Q_REF,
            "q_meas": "the links' bending is not in it",
            "p_meas": "",
            "i_meas": "",
            "p_WG_model": "compared with goal and tip",
            "p_WG_est": "compared with the tip",
            "outside": "its share of the path is a metric",
            "model_mismatch": "its share is a metric where tracker or IMUs are wired",
            "innovation": "",
            "method": "the scenario's",
            "p_WG_meas": "wired where the loop is closed",
            "tilt_meas": "wired where there are IMUs",
        },
        remarks=(_WORLD,),
    ),
    "arm": Place(
        required={
            "q_cmd": "",
            "qd_cmd": "",
            "q_meas": "",
            "p_meas": "",
            "i_meas": "",
            "p_WG": "",
            "p_WG_meas": "by it the run is judged",
            "shape": "",
        },
        optional={
            "p_cmd": "",
            "tilt_meas": "wired where there are IMUs",
            **dict.fromkeys(("link_2", "link_3"), "by the scenario's parameter links"),
            "load": "the scenario's parameter",
            "q_0": "the tip is 0.3 m from the base, level with the shoulder",
            **dict.fromkeys(
                ("base_step", "encoder_step", "transducer_step", "regulator_step"), "set for resolution=electronics"
            ),
            **dict.fromkeys(
                ("EI_factor", "mass_factor", "friction_factor", "joint_factor", "L_2", "L_3"),
                "set for an arm that differs from the usual one",
            ),
            "seed": "follows from the run's seed",
        },
        remarks=(_WORLD,),
    ),
}
"""By the units' names in the system."""

_SENSORS = {"closed_loop": "p_WG_meas", "imu": "tilt_meas"}
"""By the parameter of the kinematics that makes it look at a sensor, the input at which that is read."""


FIXED_VALUES = {
    "arm.links": "planner and kinematics are of an arm of two links; for other arms write a system of your own"
}
"""What is fixed in all scenarios of the arm, by the unit's value, and why."""


def fixed_value_faults(given: Sequence[str], fixed: Mapping[str, str] = FIXED_VALUES) -> list[str]:
    """Return which of the units' values that were set, by name, are fixed in a scenario, by `fixed`, and why."""
    return [f"{name}: {why}" for name, why in fixed.items() if name in given]


def sensor_faults(system: System, given: Sequence[str], remedy: str) -> list[str]:
    """Return which sensors the kinematics use that nothing is connected to: they would read 0.

    Args:
        system: as it is wired.
        given: names of the units' parameters that were set.
        remedy: what would be right, with `{}` for the parameter's setting.
    """
    kinematics = system.units["kinematics"]
    fed = system.fed_inputs("kinematics")
    faults: list[str] = []
    for name, port in _SENSORS.items():
        value = kinematics.start.get(name)
        if f"kinematics.{name}" in given and value not in (None, False, "NONE", 0) and port not in fed:
            text = Imu(value).name if name == "imu" and isinstance(value, int) else str(value)
            setting = f"{name}={text.lower()}"
            faults.append(
                f"kinematics.{name}: nothing is connected to kinematics.{port}, which would read 0; "
                + remedy.format(setting)
            )
    return faults
