"""Checks one FMU file: archive, description, interface, binaries, loading, a short run, and the related files in it.

`check_fmu` runs the parts in this order, each only if the ones before it allow. The description is checked by FMPy's
validation with the standard's schema and rules (`standard_findings`) and by `description_checks`; the libraries'
formats and platforms are checked before one is loaded (`binary_findings`); loading and running happen in isolated
processes. Of an FMU with a manifest of related files this is checked, and the experiments in it are run.
"""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from handover.cosim.check.description_checks import description_findings, interface_findings, says
from handover.cosim.check.experiment_check import ExperimentCheck
from handover.cosim.check.report import EXPERIMENTS, RUN, CheckReport, Section
from handover.cosim.exceptions import InvalidFmu, counted
from handover.cosim.experiments.manifest import MANIFEST, related_files
from handover.cosim.experiments.reference_experiment import ReferenceExperiment, experiments_in
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.file.archive import DESCRIPTION, TERMINALS, FmuArchive
from handover.cosim.fmu.file.default_experiment import default_experiment, proposed_step
from handover.cosim.fmu.file.described_variable import DescribedVariable, variables_of
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.fmpy_edge import (
    checked_xml,
    libraries_in,
    library_path,
    missing_library,
    platform_folder,
    platforms_in,
    problems_of,
    read_description,
    required_functions,
    terminal_problems,
    version_of,
)
from handover.cosim.fmu.file.library_format import HEAD, platforms_of, shortage
from handover.cosim.fmu.file.terminals import Terminals, read_terminals
from handover.cosim.fmu.file.xml import XmlElement
from handover.cosim.probe.finding import Finding, Level, fault, note, warning
from handover.cosim.probe.isolated_process import run_isolated

_SCHEMA = re.compile(
    r"^(?:Fatal )?(?:ERROR|Error|WARNING) \(line (\d+), column \d+\): (.*)$", re.DOTALL | re.IGNORECASE
)
_SETS = re.compile(
    r"(?P<list>\S+) does not contain the expected set of variables\. "
    r"Expected \{(?P<expected>.*)\} but was \{(?P<given>.*)\}\.",
    re.DOTALL,
)
_CURES = {
    "Exactly one independent variable must be defined.": 'one Float64 with causality="independent" is wanted, the time'
}
_MAX_NAMES = 20
_OUTPUTS = "ModelStructure/Outputs must have exactly one entry"  # reported by description_checks, which names them


def standard_findings(path: Path, own: Sequence[Finding]) -> list[Finding]:
    """Return what FMPy's validation finds in an FMU that is safe to read; `own` are the findings of other checks."""
    problems, stopped = problems_of(path)
    own_lines = " ".join(f.line for f in own)
    findings = [
        _finding(p)
        for p in dict.fromkeys(problems)
        if not (p.startswith(_OUTPUTS) and "ModelStructure does not list" in own_lines)
    ]
    if stopped and not findings and not own:
        findings.append(fault(f"the description cannot be understood: {stopped}", where=DESCRIPTION))
    return findings


def _finding(problem: str) -> Finding:
    if sets := _SETS.fullmatch(problem):
        expected, given = (_names(sets[group]) for group in ("expected", "given"))
        parts = [
            f"{verb} {_listed(names)}"
            for verb, names in (("lacks", expected - given), ("should not have", given - expected))
            if names
        ]
        return fault(f"{sets['list']} {' and '.join(parts)}", where=DESCRIPTION)
    match = _SCHEMA.match(problem)
    where = f"{DESCRIPTION}, line {match[1]}" if match else DESCRIPTION
    lines = [line.strip() for line in (match[2] if match else problem).splitlines() if line.strip()]
    what = _shortened(lines[0] if len(lines) > 3 else " ".join(lines))
    return fault(what.rstrip("."), where=where, cure=_CURES.get(problem, ""))


def _names(text: str) -> set[str]:
    return {name for part in text.split(", ") if (name := part.strip())}


def _listed(names: set[str]) -> str:
    """Return names in natural order, y2 before y10."""
    ordered = sorted(names, key=lambda name: [part.zfill(9) for part in re.split(r"(\d+)", name)])
    more = f" and {len(ordered) - _MAX_NAMES} more" if len(ordered) > _MAX_NAMES else ""
    return ", ".join(ordered[:_MAX_NAMES]) + more


def _shortened(text: str) -> str:
    return text if len(text) <= 400 else text[:397] + "..."


def terminal_findings(archive: FmuArchive, terminals: Terminals) -> Iterator[Finding]:
    """Yield what is wrong with an FMU's terminals, and, as notes, which cannot be connected as a whole here."""
    if terminals.fault:
        yield fault(terminals.fault)
    elif TERMINALS in archive.names:
        for problem in terminal_problems(archive.read(TERMINALS)):
            yield fault(problem, where=TERMINALS)
    for t in terminals.by_name.values():
        for what in t.faults:
            yield fault(what, where=t.where)
        for what in t.limits:
            yield note(f"cannot be connected as a whole: {what}", where=t.where)


_FMI2_FOLDERS = {
    "linux32": ("x86-linux",),
    "linux64": ("x86_64-linux",),
    "win32": ("x86-windows",),
    "win64": ("x86_64-windows",),
    "darwin64": ("x86_64-darwin", "aarch64-darwin"),
}


def binary_findings(archive: FmuArchive, fmi: int, identifier: str) -> Iterator[Finding]:
    """Yield what is wrong with the libraries' names, folders, formats and lengths."""
    wanted = library_path(fmi, identifier)
    if lack := missing_library(archive, fmi, identifier):
        yield fault(lack.what, where=lack.where, cure=lack.cure)
    for library in libraries_in(archive):
        if library.stem == identifier:
            yield from _format_findings(archive, library, fmi, here=str(library) == wanted)
        if short := shortage(archive.head(str(library), HEAD), archive.size(str(library))):
            level = fault if library.parts[1] == platform_folder(fmi) else warning
            yield level(short, where=str(library))


def _format_findings(archive: FmuArchive, library: PurePosixPath, fmi: int, *, here: bool) -> Iterator[Finding]:
    made_for = platforms_of(archive.head(str(library), HEAD))
    folder = library.parts[1]
    meant = _FMI2_FOLDERS.get(folder, ()) if fmi == 2 else ("-".join(folder.split("-")[:2]),)  # an ABI may follow
    if here and not made_for:
        yield fault("not a shared library", where=str(library))
    elif meant and not set(made_for) & set(meant):
        level = fault if here else warning
        yield level(f"made for {' and '.join(made_for) or 'no known platform'}, not for {folder}", where=str(library))


_STEP = 0.01  # seconds, where the FMU asks for none


class _Skipped(Exception):
    """A part of a check cannot run; the message says where the reason is reported."""


def check_fmu(path: Path, timeout: float) -> CheckReport:
    """Check a file that is there; loading and running may each take `timeout` seconds. It never raises for the file."""
    sections: list[Section] = []
    with scratch_folder("check") as scratch:
        check = _Check(path, timeout, scratch)
        reason = ""
        for name, run_part in check.parts():
            if reason:
                sections.append(Section(name, reason, reached=False))
                continue
            section = _section(name, run_part)
            sections.append(section)
            if section.level is Level.FAULT and not check.can_continue:
                reason = f"not reached: see {name}"
    return CheckReport(path, tuple(sections))


def _section(name: str, run_part: Callable[[], tuple[str, list[Finding]]]) -> Section:
    try:
        text, findings = run_part()
    except _Skipped as e:
        return Section(name, str(e), reached=False)
    except InvalidFmu as e:
        text, findings = "", [fault(e.fault)]
    return Section(name, text, tuple(findings))


class _Check:
    """One file's check; each part stores what the next ones need, and in `can_continue` whether they can follow."""

    def __init__(self, path: Path, timeout: float, scratch: Path) -> None:
        self.path, self.timeout, self.scratch = path, timeout, scratch
        self.can_continue = self.is_described = False
        self.experiments: list[ReferenceExperiment] = []

    def parts(self) -> Iterator[tuple[str, Callable[[], tuple[str, list[Finding]]]]]:
        """Yield the parts by name; each must have been run before the next is asked for."""
        yield "archive", self._archive
        yield "description", self._description
        yield "interface", self._interface
        if self.can_continue and MANIFEST in self.archive.names:
            yield "references", self._references
        yield "binaries", self._binaries
        yield "loading", self._loading
        yield RUN, self._run
        if self.experiments:
            yield EXPERIMENTS, self._experiments

    def _archive(self) -> tuple[str, list[Finding]]:
        self.archive = FmuArchive(self.path)
        self.archive.verify()
        findings = [
            warning("compressed in a way that the standards do not know", where=name, cure="use deflate")
            for name in self.archive.outdated_methods
        ]
        if backslashes := self.archive.with_backslashes:
            what = f"{len(backslashes)} names have backslashes between folders, which other tools refuse"
            findings.append(warning(what, where=backslashes[0], cure="zip it with slashes"))
        is_folder, n = self.path.is_dir(), len(self.archive.names)
        size = sum(map(self.archive.size, self.archive.names)) if is_folder else self.path.stat().st_size
        return f"{counted(n, 'file')} in {math.ceil(size / 1000)} kB", findings

    def _description(self) -> tuple[str, list[Finding]]:
        self.root = checked_xml(self.archive)
        self.fmi = version_of(self.path, self.root)
        variables = variables_of(self.root, self.fmi)
        own = description_findings(self.root, self.fmi, variables)
        self.can_continue = True
        n = len(variables)
        text = f"{self.root.get('modelName')}, FMI {self.root.get('fmiVersion')}, {counted(n, 'variable')}"
        findings = [*standard_findings(self.path, own), *own]
        self.is_described = all(f.level is not Level.FAULT for f in findings)
        return text, [*findings, *terminal_findings(self.archive, self._terminals(variables))]

    def _terminals(self, variables: Sequence[DescribedVariable]) -> Terminals:
        """Return the terminals; of a description that cannot be understood only what is wrong with their names."""
        try:
            if self.is_described:
                return describe_fmu(self.path).terminals
        except InvalidFmu:  # which the run reports
            pass
        named = read_terminals(self.archive, {v.name: v.causality for v in variables}, {})
        return replace(named, by_name={name: replace(t, limits=()) for name, t in named.by_name.items()})

    def _interface(self) -> tuple[str, list[Finding]]:
        findings = list(interface_findings(self.root, self.fmi))
        interface = next(self.root.named("CoSimulation"), None)
        self.can_continue = interface is not None
        self.interface = interface or self.root
        self.identifier = self.interface.get("modelIdentifier")
        experiment = default_experiment(self.root)
        step, presumed = proposed_step(experiment.step), experiment.presumed_step
        run = f"a run takes {float(presumed):g} s" if presumed else "a run takes a 500th of --stop"
        text = f"co-simulation, {f'steps of {float(step):g} s' if step else f'no step size given: {run}'}"
        return text if interface else "no co-simulation", findings

    def _references(self) -> tuple[str, list[Finding]]:
        files, findings = related_files(self.archive)
        self.experiments, more = experiments_in(files)
        return counted(len(files), "related file"), [*findings, *more]

    def _binaries(self) -> tuple[str, list[Finding]]:
        findings = list(binary_findings(self.archive, self.fmi, self.identifier))
        self.can_continue = all(f.level is not Level.FAULT for f in findings)
        return ", ".join(platforms_in(self.archive)), findings

    def _loading(self) -> tuple[str, list[Finding]]:
        self.can_continue = False
        self.folder = self.scratch / "fmu"
        self.archive.unpack(self.folder)
        functions = required_functions(self.fmi)
        task = {"library": str(self.folder / library_path(self.fmi, self.identifier)), "functions": functions}
        report = run_isolated("handover.cosim.check.load_probe", task, self.scratch, self.timeout)
        return f"{len(functions)} functions on {platform_folder(self.fmi)}", report.findings

    def _run(self) -> tuple[str, list[Finding]]:
        try:
            read_description(self.path)
        except InvalidFmu as e:
            if not self.is_described:
                raise _Skipped("not tried: its description is invalid, see there") from e
            return "", [fault(e.fault)]
        experiment = default_experiment(self.root)
        step = float(proposed_step(experiment.step) or experiment.presumed_step or _STEP)
        capabilities = dict(_state_capabilities(self.interface, self.fmi))
        task = {
            "fmu": str(self.path.absolute()),
            "folder": str(self.folder),
            "start": experiment.start or 0.0,
            "step": step,
            **capabilities,
        }
        report = run_isolated("handover.cosim.check.smoke_run", task, self.scratch, self.timeout)
        parts = [f"{report.facts['steps']} steps of {step:g} s"] if "steps" in report.facts else []
        if "ended" in report.facts:
            done = ("state restored", capabilities["keeps_state"]), ("second instance", capabilities["allows_two"])
            parts += [what for what, was_done in (*done, ("reset", True)) if was_done]
        return ", ".join(parts) or "stopped", report.findings

    def _experiments(self) -> tuple[str, list[Finding]]:
        names = [v.name for v in variables_of(self.root, self.fmi)]
        check = ExperimentCheck(self.archive, describe_fmu(self.path), names, self.folder, self.scratch, self.timeout)
        results = [check.run(experiment) for experiment in self.experiments]
        findings = [f for _, found in results for f in found]
        return "; ".join(text for text, _ in results if text), findings


def _state_capabilities(interface: XmlElement, fmi: int) -> Iterator[tuple[str, bool]]:
    word = "state" if fmi == 2 else "State"
    keeps = says(interface, f"canGetAndSetFMU{word}")
    yield "keeps_state", keeps
    yield "serialises", keeps and says(interface, f"canSerializeFMU{word}")
    yield "allows_two", not says(interface, "canBeInstantiatedOnlyOncePerProcess")
