"""Checks an SSP file: the system as the master takes it, then each FMU in it by itself."""

import contextlib
import logging
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path

from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.check.report import CheckReport, Section
from handover.cosim.exceptions import InvalidSsp, named_by_archive
from handover.cosim.files import scratch_folder
from handover.cosim.fmu.file.default_experiment import NoStep
from handover.cosim.probe.finding import Finding, fault, warning
from handover.cosim.ssp.archive import SspArchive, ssp_root
from handover.cosim.ssp.flattening import components_of
from handover.cosim.ssp.reading import read_structure
from handover.cosim.ssp.ssp_file import SspFile


def check_ssp(path: Path, timeout: float) -> Iterator[CheckReport]:
    """Yield the reports of an SSP that is there: of its system, then of its FMUs, as `x.ssp/resources/arm.fmu`.

    Loading and running may each take `timeout` seconds of each FMU. It never raises for the file.
    """
    yield CheckReport(path, (_system(path),))
    with scratch_folder("check") as folder, named_by_archive(folder, path):
        try:
            archive = SspArchive(path)
            components = [component for _, component in components_of(read_structure(archive).system)]
            archive.unpack(folder, {component.member for component in components})
        except InvalidSsp:  # which the first report tells
            return
        for member in dict.fromkeys(component.member for component in components):
            yield replace(check_fmu(folder / member, timeout), path=ssp_root(path) / member)


def _system(path: Path) -> Section:
    try:
        with _warnings() as lines, SspFile(path) as ssp:
            units, connections = len(ssp.system.units), len(ssp.system.connections)
            until = "no stop time given: a run needs --stop" if ssp.stop is None else f"until {float(ssp.stop):g} s"
            text = f"{ssp.name}, units: {units}, connections: {connections}, {until}"
            return Section("system", text, tuple(map(warning, [*lines, *ssp.system.remarks])))
    except InvalidSsp as e:
        return Section("system", "", tuple(_finding(line) for line in e.faults))


@contextlib.contextmanager
def _warnings() -> Generator[list[str], None, None]:
    """Give the warnings that are logged as an SSP is read, such as of values that nothing has."""
    lines: list[str] = []

    class Lines(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    handler, logger = Lines(logging.WARNING), logging.getLogger(__package__)
    level, logger.propagate = logger.level, False
    logger.setLevel(logging.WARNING)
    logger.addHandler(handler)
    try:
        yield lines
    finally:
        logger.removeHandler(handler)
        logger.propagate = True
        logger.setLevel(level)


def _finding(line: str) -> Finding:
    """Return a fault; no more than a warning where a run has an option for what the file leaves open."""
    return warning(line, cure="a run needs --step") if isinstance(line, NoStep) else fault(line)
