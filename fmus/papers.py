"""The papers that blocks are after, by the key with which docstrings cite them."""

PAPERS = {
    "Fernandes2020": 'Fernandes, "Object handover between humans and robots in microgravity", MSc thesis, '
    "Instituto Superior Tecnico, Lisbon 2020",
    "Gandarias2020": 'Gandarias et al., "Open-loop position control in collaborative, modular '
    'Variable-Stiffness-Link (VSL) robots", IEEE Robotics and Automation Letters 2020',
    "Luberto": 'Luberto et al., "Enhancing adaptive grasp planning through a simple sensor-based reflex mechanism"',
    "Vervloet2025": 'Vervloet, "A first step to visual servoing based autonomous handovers with soft robots", '
    "TU Delft 2025",
}


def cited(text: str) -> dict[str, str]:
    """Return the papers that a text cites as `[key]`."""
    return {key: paper for key, paper in PAPERS.items() if f"[{key}]" in text}
