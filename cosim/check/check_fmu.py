"""Checks one file: archive, description, interface, binaries, loading, and a short run."""

import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from handover.cosim.check.binary_checks import binary_findings, platforms_in
from handover.cosim.check.check_report import CheckReport, Section
from handover.cosim.check.described_variable import variables_of
from handover.cosim.check.finding import Finding, Level, fault, warning
from handover.cosim.check.interface_checks import default_start, default_step, interface_findings, says
from handover.cosim.check.standard_checks import standard_findings
from handover.cosim.check.structure_checks import structure_findings
from handover.cosim.check.variable_checks import variable_findings
from handover.cosim.check.watched_process import watch
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.archive import FmuArchive
from handover.cosim.fmu.fmpy_edge import (
    checked_xml,
    library_path,
    platform_folder,
    read_description,
    required_functions,
    version_of,
)
from handover.cosim.fmu.xml import XmlElement

_STEP = 0.01  # seconds, where the FMU asks for none


class _NotTried(Exception):
    """A part of a check has nothing to go by; the message says where the reason is told."""


def check_fmu(path: Path, timeout: float) -> CheckReport:
    """Check a file that is there; loading and running may each take `timeout` seconds. It never raises for the file."""
    sections: list[Section] = []
    with tempfile.TemporaryDirectory(prefix="handover-check-", ignore_cleanup_errors=True) as scratch:
        check = _Check(path, timeout, Path(scratch))
        reason = ""
        for name, carry_out in check.parts:
            if reason:
                sections.append(Section(name, reason, reached=False))
                continue
            section = _section(name, carry_out)
            sections.append(section)
            if section.level is Level.FAULT and not check.goes_on:
                reason = f"not reached: see {name}"
    return CheckReport(path, tuple(sections))


def _section(name: str, carry_out: Callable[[], tuple[str, list[Finding]]]) -> Section:
    try:
        told, findings = carry_out()
    except _NotTried as e:
        return Section(name, str(e), reached=False)
    except InvalidFmu as e:
        told, findings = "", [fault(e.fault)]
    return Section(name, told, tuple(findings))


class _Check:
    """One file's check; each part leaves what the next ones need, and says in `goes_on` whether they can follow."""

    def __init__(self, path: Path, timeout: float, scratch: Path) -> None:
        self.path, self.timeout, self.scratch = path, timeout, scratch
        self.goes_on = self.is_described = False
        self.parts = (
            ("archive", self._archive),
            ("description", self._description),
            ("interface", self._interface),
            ("binaries", self._binaries),
            ("loading", self._loading),
            ("run", self._run),
        )

    def _archive(self) -> tuple[str, list[Finding]]:
        self.archive = FmuArchive(self.path)
        self.archive.verify()
        findings = [
            warning("compressed in a way that the standards do not know", where=name, cure="use deflate")
            for name in self.archive.outdated_methods
        ]
        size, n = self.path.stat().st_size, len(self.archive.names)
        return f"{n} file{'s' if n != 1 else ''} in {math.ceil(size / 1000)} kB", findings

    def _description(self) -> tuple[str, list[Finding]]:
        self.root = checked_xml(self.archive)
        self.fmi = version_of(self.path, self.root)
        variables = variables_of(self.root, self.fmi)
        own = [*variable_findings(self.root, self.fmi, variables), *structure_findings(self.root, self.fmi, variables)]
        self.goes_on = True
        n = len(variables)
        told = f"{self.root.get('modelName')}, FMI {self.root.get('fmiVersion')}, {n} variable{'s' if n != 1 else ''}"
        findings = [*standard_findings(self.path, own), *own]
        self.is_described = all(f.level is not Level.FAULT for f in findings)
        return told, findings

    def _interface(self) -> tuple[str, list[Finding]]:
        findings = list(interface_findings(self.root, self.fmi))
        interface = next(self.root.named("CoSimulation"), None)
        self.goes_on = interface is not None
        self.interface = interface or self.root
        self.identifier = self.interface.get("modelIdentifier")
        step = default_step(self.root)
        told = f"co-simulation, {'steps of ' + f'{step:g} s' if step else 'no step size given'}"
        return told if interface else "no co-simulation", findings

    def _binaries(self) -> tuple[str, list[Finding]]:
        findings = list(binary_findings(self.archive, self.fmi, self.identifier))
        self.goes_on = all(f.level is not Level.FAULT for f in findings)
        return ", ".join(platforms_in(self.archive)), findings

    def _loading(self) -> tuple[str, list[Finding]]:
        self.goes_on = False
        self.folder = self.scratch / "fmu"
        self.archive.unpack(self.folder)
        functions = required_functions(self.fmi)
        task = {"library": str(self.folder / library_path(self.fmi, self.identifier)), "functions": functions}
        watched = watch("handover.cosim.check.load_probe", task, self.scratch, self.timeout)
        return f"{len(functions)} functions on {platform_folder(self.fmi)}", watched.findings

    def _run(self) -> tuple[str, list[Finding]]:
        try:
            read_description(self.path)
        except InvalidFmu as e:
            if not self.is_described:
                raise _NotTried("not tried: its description cannot be used, see there") from e
            return "", [fault(e.fault)]
        step = default_step(self.root) or _STEP
        capabilities = dict(_capabilities(self.interface, self.fmi))
        task = {
            "fmu": str(self.path.absolute()),
            "folder": str(self.folder),
            "start": default_start(self.root),
            "step": step,
            **capabilities,
        }
        watched = watch("handover.cosim.check.run_probe", task, self.scratch, self.timeout)
        parts = [f"{watched.facts['steps']} steps of {step:g} s"] if "steps" in watched.facts else []
        if "ended" in watched.facts:
            done = ("state restored", capabilities["keeps_state"]), ("second instance", capabilities["allows_two"])
            parts += [what for what, was_done in (*done, ("reset", True)) if was_done]
        return ", ".join(parts) or "stopped", watched.findings


def _capabilities(interface: XmlElement, fmi: int) -> Iterator[tuple[str, bool]]:
    word = "state" if fmi == 2 else "State"
    keeps = says(interface, f"canGetAndSetFMU{word}")
    yield "keeps_state", keeps
    yield "serialises", keeps and says(interface, f"canSerializeFMU{word}")
    yield "allows_two", not says(interface, "canBeInstantiatedOnlyOncePerProcess")
