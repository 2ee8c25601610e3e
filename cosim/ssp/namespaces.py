"""Names of elements in an SSP's XML files, by the prefixes that the standard uses for their namespaces."""

NAMESPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": "http://ssp-standard.org/SSP1/SystemStructureParameterValues",
    "ssm": "http://ssp-standard.org/SSP1/SystemStructureParameterMapping",
}
"""The same in SSP 1.0 and 2.0."""

STRUCTURE = "SystemStructure.ssd"
"""What an SSP's archive has at its top."""

STEP_ANNOTATION = "handover.communication"
"""Type of the annotation of a component whose communication step is not the one that its FMU proposes."""

_PREFIXES = {uri: prefix for prefix, uri in NAMESPACES.items()}


def tag(name: str) -> str:
    """Return an element's full name: `{http://...}System` for `ssd:System`."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def told(full: str) -> str:
    """Return an element's short name: `ssd:System` for `{http://...}System`."""
    uri, _, local = full.removeprefix("{").rpartition("}")
    return f"{_PREFIXES[uri]}:{local}" if uri in _PREFIXES else local


def shortened(message: str) -> str:
    """Return a message in which full names of elements are short ones."""
    for uri, prefix in _PREFIXES.items():
        message = message.replace(f"{{{uri}}}", f"{prefix}:")
    return message


def local(full: str) -> str:
    """Return an element's name without its namespace."""
    return full.rpartition("}")[2]
