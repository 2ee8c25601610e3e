"""A grasp by reflexes in which all is amiss at once: of the scenario, and of the units' own parameters."""

DISTURBED = (
    "correction=fast",
    "thing=polygon",
    "carried_speed=0.01",
    "nudge=0.01,0.005",
    "nudge_time=1",
    "other_radius=0.02",
    "other_place=0.02,0.11",
)
OFF = {
    "scene.sensor_tolerance": "0.05",
    "scene.ambient": "10",
    "scene.active": "2",
    "scene.crosstalk": "0.02",
    "scene.gloss": "0.2",
    "scene.fingers_seen": "true",
    "scene.wrist_noise": "0.0002",
}
