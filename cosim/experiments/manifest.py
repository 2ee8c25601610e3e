"""The related files of an FMU, with their roles, as the layered standard FMI-LS-REF lists them in a manifest.

The manifest, `extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml`, has an element `Related` for each file: its MIME
type, its place as a URI relative to the manifest, its role and a description, and labels. Whoever has changed the
archive meanwhile may not have known the manifest, so that a file which is listed may be gone: that is a warning.
"""

import posixpath
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import unquote, urlsplit

from handover.cosim.fmu.file.archive import FmuArchive, listed
from handover.cosim.fmu.file.xml import UnsafeXml, XmlElement, parse_xml
from handover.cosim.probe.finding import Finding, fault, note, warning

STANDARD = "org.fmi-standard.fmi-ls-ref"
FOLDER = f"extra/{STANDARD}"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
ROOT = "fmiReferences"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
"""Of the root's attributes, which all layered standards have."""
VERSION = "1.0.0-alpha.1"
"""The version that the standard's text gives."""
DESCRIPTION = "Layered Standard providing information on related files included in an FMU."
"""The description that the standard fixes."""

EXPERIMENT = "experiment"
RESULT = "result"
_SUB_ROLES = {EXPERIMENT: ("smoke-test", "validation", "uncertainty-analysis")}
_FREE_SUB_ROLE = "serialized-state"
ROLES = (
    *("document", "requirement", "specification", "model", "parameter", "system", "testcase", EXPERIMENT, RESULT),
    *("method", "rationale", "report", "request", "delivery", "configuration", "signature", _FREE_SUB_ROLE),
    *("meta-data", "other"),
)
"""The main roles."""


@dataclass(frozen=True)
class RelatedFile:
    """A file of a manifest.

    Attributes:
        path: its path in the archive; empty where it is not there, or lies elsewhere.
        source: its URI as written.
        role: its main role.
        sub_role: what stands after a slash; empty without.
        type: its MIME type.
        labels: the names of its labels.
        annotations: the elements in its annotations.
        line: of its element in the manifest.
    """

    path: str
    source: str
    role: str
    sub_role: str
    type: str
    labels: Sequence[str]
    annotations: Sequence[XmlElement]
    line: int

    @property
    def where(self) -> str:
        """Its place in the manifest, for messages."""
        return f"{MANIFEST}, line {self.line}"


def related_files(archive: FmuArchive) -> tuple[list[RelatedFile], list[Finding]]:
    """Return the files of an FMU's manifest, and what is wrong with it; of an FMU without one, none.

    Raises:
        InvalidFmu: the archive is damaged.
    """
    if MANIFEST not in archive.names:
        return [], []
    try:
        root = parse_xml(archive.read(MANIFEST))
    except UnsafeXml as e:
        return [], [fault(str(e), where=MANIFEST)]
    if root.tag != ROOT:
        return [], [fault(f"its outermost element is <{root.tag}>", where=MANIFEST, cure=f"expected <{ROOT}>")]
    findings = list(_root_findings(root))
    files: list[RelatedFile] = []
    for element in root.children:
        if element.tag == "Related":
            files.append(_related(archive, element))
            findings += _findings(archive, element, files[-1])
        elif element.tag != "Annotations":
            where = f"{MANIFEST}, line {element.line}"
            cure = "expected <Related> or <Annotations>"
            findings.append(fault(f"<{element.tag}> is not known", where=where, cure=cure))
    return files, findings


def _root_findings(root: XmlElement) -> Iterator[Finding]:
    where = f"{MANIFEST}, line {root.line}"
    for name, wanted in (("name", STANDARD), ("version", ""), ("description", DESCRIPTION)):
        given = root.attributes.get(f"{{{NAMESPACE}}}fmi-ls-{name}")
        if given is None:
            what = f"it has no attribute fmi-ls-{name} of the namespace {NAMESPACE}"
            yield fault(what, where=where, cure=f"expected {wanted!r}" if wanted else f"such as {VERSION}")
        elif wanted and given != wanted:
            level = fault if name == "name" else warning
            yield level(f"fmi-ls-{name}={given[:80]!r}", where=where, cure=f"expected {wanted!r}")


def _related(archive: FmuArchive, element: XmlElement) -> RelatedFile:
    role, _, sub_role = element.get("role").partition("/")
    source = element.get("source")
    path = path_in_archive(source) or ""
    return RelatedFile(
        path=path if path in archive.names else "",
        source=source,
        role=role,
        sub_role=sub_role,
        type=element.get("type", "application/octet-stream"),
        labels=tuple(label.get("name") for label in element.named("Label")),
        annotations=tuple(a for each in element.named("Annotations", "Annotation") for a in each.children),
        line=element.line,
    )


def _findings(archive: FmuArchive, element: XmlElement, file: RelatedFile) -> Iterator[Finding]:
    yield from _role_findings(element, file)
    if not file.source:
        yield fault("a file without a source", where=file.where, cure="expected a URI relative to the manifest")
    elif _is_absolute(file.source):
        yield note(f"{file.source[:200]!r} lies outside of the FMU and was not looked at", where=file.where)
    elif (path := path_in_archive(file.source)) is None:
        cure = "expected a path relative to the manifest, at most two folders up"
        yield fault(f"{file.source[:200]!r} leads out of the archive", where=file.where, cure=cure)
    elif not file.path:
        there = [name for name in archive.names if name.startswith(f"{FOLDER}/") and name != MANIFEST]
        cure = f"in that folder there are {listed(there)}" if there else "that folder has nothing but the manifest"
        yield warning(f"{path} is not in the archive", where=file.where, cure=cure)


def _role_findings(element: XmlElement, file: RelatedFile) -> Iterator[Finding]:
    given = element.get("role")
    if file.role not in ROLES:
        yield fault(f"role {given[:80]!r} is not known", where=file.where, cure=f"expected one of {', '.join(ROLES)}")
    elif "/" in given and file.role != _FREE_SUB_ROLE and file.sub_role not in _SUB_ROLES.get(file.role, ()):
        valid = ", ".join(f"{file.role}/{sub}" for sub in _SUB_ROLES.get(file.role, ()))
        cure = f"expected {file.role}{f', {valid}' if valid else ''}"
        yield fault(f"role {given[:80]!r} has a sub-role that is not known", where=file.where, cure=cure)


def path_in_archive(source: str) -> str | None:
    """Return the path in the archive that a relative URI of the manifest names; None where it leads out of it."""
    try:
        path = unquote(urlsplit(source).path)
    except ValueError:  # such as http://[
        return None
    whole = posixpath.normpath(posixpath.join(FOLDER, path))
    is_outside = path.startswith("/") or "\\" in path or whole.startswith("../") or whole in (".", "..")
    return None if is_outside else whole


def _is_absolute(source: str) -> bool:
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", source) is not None or source.startswith("//")
