"""terminalsAndIcons.xml of our FMUs: valid by the standard's schema in every form, and read back as declared."""

import zipfile
from pathlib import Path

import pytest

from handover.cosim.blocks.description import describe
from handover.cosim.fmu.file.archive import TERMINALS
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.fmpy_edge import terminal_problems
from handover.fmus.build import cached
from handover.fmus.catalog import find_unit, import_class


def written(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read(TERMINALS).decode()


@pytest.mark.parametrize(("fmi", "scalar"), [(2, False), (3, False), (3, True)])
def test_each_form_has_the_terminals_that_the_block_declares(fmi: int, *, scalar: bool):
    fmu = cached("Push", fmi, scalar=scalar)
    declared = describe(import_class(find_unit("Push").block)).terminals
    read = describe_fmu(fmu).terminals
    assert terminal_problems(written(fmu).encode()) == []
    assert not read.fault
    assert {t.name: {m.name: m.port for m in t.members} for t in read.by_name.values()} == {
        t.name: dict(t.members) for t in declared
    }
    assert [(t.rule, t.kind, t.reason) for t in read.by_name.values()] == [
        (t.kind.rule, t.kind.standard_name, "") for t in declared
    ]


def test_an_array_is_one_member_in_fmi_3_and_one_for_each_entry_elsewhere():
    array, entries = written(cached("Push", 3)), written(cached("Push", 2))
    assert array.count("<TerminalMemberVariable") == 2
    assert '<TerminalMemberVariable variableName="tau_G" memberName="tau_G" variableKind="signal" />' in array
    assert entries.count("<TerminalMemberVariable") == 6
    assert '<TerminalMemberVariable variableName="f_G[3]" memberName="f_G[3]" variableKind="signal" />' in entries
    assert 'fmiVersion="3.0"' in entries  # the version that defines the file, also within an FMU of FMI 2


def test_without_terminals_the_file_tells_of_the_icon_alone_and_in_fmi_2_there_is_none():
    assert "<Terminals>" not in written(cached("TrajectoryPlanner", 3))
    assert "<GraphicalRepresentation>" in written(cached("TrajectoryPlanner", 3))
    with zipfile.ZipFile(cached("TrajectoryPlanner", 2)) as archive:
        assert TERMINALS not in archive.namelist()
