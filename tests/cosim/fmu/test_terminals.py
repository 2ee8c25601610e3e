"""Terminals of any tool's FMU: what is read of them, what `handover check` finds wrong, and that a run does without."""

from pathlib import Path

import pytest
from support.cosim.terminal_units import described_unit, terminal_xml
from support.wording import Wording

from handover.cosim.blocks.terminals import MatchingRule
from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.terminals import TerminalMember
from handover.cosim.probe.finding import Level

pytestmark = pytest.mark.usefixtures("probes")

INPUTS, OUTPUTS = {"f": "N 3", "u": "N"}, {"p": "m 3", "y": "m"}


def unit(folder: Path, *terminals: str, scalar: bool = False) -> Path:
    return described_unit(folder / "unit.fmu", INPUTS, OUTPUTS, "".join(terminals), scalar=scalar)


def found(file: Path) -> tuple[str, str]:
    """Return the faults and the notes of a check."""
    (section,) = (s for s in check_fmu(file, timeout=5.0).sections if s.name == "description")
    faults, notes = ("\n".join(f.line for f in section.findings if f.level is x) for x in (Level.FAULT, Level.NOTE))
    return faults, notes


def test_rules_kinds_and_members_are_read_and_terminals_within_others_are_named_after_them(tmp_path: Path):
    inner = terminal_xml("inner", "bus", Y="y")
    file = unit(tmp_path, terminal_xml("flange", "plug", "Some.Flange", within=inner, F="f inflow", P="p"))
    terminals = describe_fmu(file).terminals
    flange, within = terminals.by_name["flange"], terminals.by_name["flange.inner"]
    assert (flange.rule, flange.kind, flange.reason) == (MatchingRule.PLUG, "Some.Flange", "")
    assert flange.members == (TerminalMember("F", "f", "inflow"), TerminalMember("P", "p", "signal"))
    assert (within.rule, within.members) == (MatchingRule.BUS, (TerminalMember("Y", "y", "signal"),))
    assert found(file) == ("", "")


def entries(order: str, names: str = "123") -> str:
    members = "".join(
        f'<TerminalMemberVariable variableName="p[{i}]" memberName="P[{n}]" variableKind="signal"/>'
        for i, n in zip(order, names, strict=False)
    )
    return f'<Terminal name="t" matchingRule="plug">{members}</Terminal>'


def test_entries_of_an_array_are_one_member(tmp_path: Path):
    file = unit(tmp_path, entries("123"), scalar=True)
    assert describe_fmu(file).terminals.by_name["t"].members == (TerminalMember("P", "p", "signal"),)


STREAM = (
    '<TerminalStreamMemberVariable inStreamMemberName="a" outStreamMemberName="b" inStreamVariableName="u" '
    'outStreamVariableName="y"/></Terminal>'
)
AGAIN = '<TerminalMemberVariable variableName="y" memberName="a" variableKind="signal"/></Terminal>'


@pytest.mark.parametrize(
    "terminals",
    [
        terminal_xml("t", "plug", p="q"),
        terminal_xml("t", "plug", p="time"),
        terminal_xml("t", "plug", **{"": "p"}),
        terminal_xml("t", "plug", a="p").replace("</Terminal>", AGAIN),
        terminal_xml("t", "bus", p="p") * 2,
        terminal_xml("t", "plug", "_handover_pose", p="p", q="y"),
        '<Terminal name="t"/>',
        "<?xml version='1.0'?><terminals/>",
        "<?xml version='1.0'?><!DOCTYPE a><a/>",
        "<?xml version='1.0'?><a>",
    ],
    ids=[
        "no variable", "independent", "no name", "member twice", "terminal twice", "no pose", "no rule", "other root",
        "document type", "not well-formed",
    ],
)  # fmt: skip
def test_what_breaks_the_standard_is_reported_and_keeps_no_unit_from_being_described(
    tmp_path: Path, terminals: str, wording: Wording
):
    file = unit(tmp_path, terminals)
    wording.check(found(file)[0])
    assert set(describe_fmu(file).outputs) == {"p", "y"}


@pytest.mark.parametrize(
    "terminals",
    [
        terminal_xml("t", "org.example.rule", p="p"),
        terminal_xml("t", "plug", p="p").replace("</Terminal>", STREAM),
        entries("12"),
        entries("132", "132"),
        entries("123", "132"),
    ],
    ids=["other rule", "stream", "entries in part", "in another order", "under other indices"],
)
def test_what_the_standard_allows_and_is_not_connected_here_is_a_note(tmp_path: Path, terminals: str, wording: Wording):
    file = unit(tmp_path, terminals, scalar="p[" in terminals)
    faults, notes = found(file)
    assert faults == ""
    wording.check(notes)
    assert describe_fmu(file).terminals.by_name["t"].reason in notes
