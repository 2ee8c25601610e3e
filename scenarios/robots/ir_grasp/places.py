"""What a unit needs to take a place in the infrared grasp."""

from handover.scenarios.experiment.places import Place

_TABLE = (
    "The scene is planar, seen from above: W lies on the table, with its origin where vision saw the object. Headings "
    "turn counter-clockwise from x of W; the hand points along its heading. Vectors are in W."
)
_HAND = {"p_WH": "", "yaw": "", "sigma": ""}
_COMMAND = {
    "p_WH_cmd": "the hand goes there at its own speed",
    "yaw_cmd": "",
    "sigma_cmd": "",
}

PLACE_OF_SENSORS = Place(
    required={
        "ticks": "",
        "range": "",
        "p_WH": "",
        "yaw": "",
        "q": "shown in space",
        "p_WO": "",
        "yaw_O": "",
        "touching": "nothing may touch the face",
        "p_WH_cmd": "the hand goes there at wrist_speed",
        "yaw_cmd": "",
        "thing": "what has the face",
        "yaw_O_0": "the scenario's parameter incidence",
        "p_WH_0": "before the face",
        "yaw_H_0": "such that the sensor looks along x of W",
        "wrist_speed": "the scenario's parameter speed",
        "reflectivity": "the scenario's parameter",
    },
    optional={"seed": "follows from the run's seed"},
    remarks=(_TABLE,),
)
"""Of a scene in which a sensor approaches a face, without a controller."""

PLACES = {
    "scene": Place(
        required={
            "ticks": "",
            **_HAND,
            **{f"{name}_meas": text for name, text in _HAND.items()},
            **_COMMAND,
            "q": "shown in space",
            "p_WO": "",
            "yaw_O": "",
            "touching": "an object that is held touches at least two",
            "range": "",
            "thing": "the scenario's parameter",
            "p_WO_0": "drawn from the run's seed",
            "yaw_O_0": "drawn from the run's seed",
            "p_WH_0": "drawn from the run's seed",
            "yaw_H_0": "drawn from the run's seed",
        },
        optional={
            "p_ground": "what it carried the object is not a displacement by the hand",
            "tension": "shown as a signal",
            "q_meas": "felt by strategy=contact and correction=fast",
            "tension_meas": "felt by strategy=contact and correction=fast",
            "carry_velocity": "by carried_speed and carried_direction",
            "p_WX": "shown in space",
            "seed": "follows from the run's seed",
        },
        remarks=(_TABLE,),
    ),
    "reflex": Place(
        required={
            **_COMMAND,
            "phase": "by it the run is judged: from PULL on the object must stay in the hand, and DONE ends the run",
        },
        optional={
            "ticks": "",
            **_HAND,
            "tension": "",
            "q": "by the joints' encoders",
            "case": "shown as a signal",
            "cost": "a metric as the hand begins to close",
            "distance": "metrics as the hand begins to close",
            "steps": "a metric",
            "stop": "a metric, and part of the verdict's reason",
            "jacobian_offset": "what a later run begins with by last_grasp",
            "jacobian_offset_0": "zeros, or of the run that the scenario's parameter last_grasp names",
            "p_WH_pregrasp": "by vision",
            "yaw_pregrasp": "by vision",
        },
        remarks=(_TABLE,),
    ),
}
"""By the units' names in the system."""
