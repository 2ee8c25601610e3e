"""Terminals of any tool's FMU: what is read of them, what `handover check` finds wrong, and that a run does without."""

from pathlib import Path

import pytest
from support.cosim.terminal_units import described_unit, terminal_xml

from handover.cosim.blocks.terminals import MatchingRule
from handover.cosim.check.check_fmu import check_fmu
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.fmu.file.terminals import TerminalMember
from handover.cosim.probe.finding import Level

INPUTS, OUTPUTS = {"f": "N 3", "u": "N"}, {"p": "m 3", "y": "m"}


def unit(folder: Path, *terminals: str, scalar: bool = False) -> Path:
    return described_unit(folder / "unit.fmu", INPUTS, OUTPUTS, "".join(terminals), scalar=scalar)


def found(file: Path, level: Level = Level.FAULT) -> str:
    (section,) = (s for s in check_fmu(file, timeout=5.0).sections if s.name == "description")
    return "\n".join(f.line for f in section.findings if f.level is level)


def test_rules_kinds_and_members_are_read_and_terminals_within_others_are_named_after_them(tmp_path: Path):
    inner = terminal_xml("inner", "bus", Y="y")
    file = unit(tmp_path, terminal_xml("flange", "plug", "Some.Flange", within=inner, F="f inflow", P="p"))
    terminals = describe_fmu(file).terminals
    flange, within = terminals.by_name["flange"], terminals.by_name["flange.inner"]
    assert (flange.rule, flange.kind, flange.reason) == (MatchingRule.PLUG, "Some.Flange", "")
    assert flange.members == (TerminalMember("F", "f", "inflow"), TerminalMember("P", "p", "signal"))
    assert (within.rule, within.members) == (MatchingRule.BUS, (TerminalMember("Y", "y", "signal"),))
    assert found(file) == found(file, Level.NOTE) == ""


def entries(order: str, names: str = "123") -> str:
    members = "".join(
        f'<TerminalMemberVariable variableName="p[{i}]" memberName="P[{n}]" variableKind="signal"/>'
        for i, n in zip(order, names, strict=False)
    )
    return f'<Terminal name="t" matchingRule="plug">{members}</Terminal>'


def test_entries_of_an_array_are_one_member(tmp_path: Path):
    file = unit(tmp_path, entries("123"), scalar=True)
    assert describe_fmu(file).terminals.by_name["t"].members == (TerminalMember("P", "p", "signal"),)


@pytest.mark.parametrize("listed", [entries("12"), entries("132", "132"), entries("123", "132")])
def test_entries_in_part_or_in_another_order_are_sound_and_not_connected(tmp_path: Path, listed: str):
    file = unit(tmp_path, listed, scalar=True)
    assert "entries of the array p in part, or in another order" in describe_fmu(file).terminals.by_name["t"].reason
    assert found(file) == ""
    assert "terminal 't' (line 1): cannot be connected as a whole" in found(file, Level.NOTE)


@pytest.mark.parametrize(
    ("terminals", "wanted"),
    [
        (terminal_xml("t", "plug", p="q"), "terminal 't' (line 1): there is no variable 'q' (line 1)"),
        (terminal_xml("t", "plug", p="time"), "'time' is independent; its members are inputs, outputs and parameters"),
        (terminal_xml("t", "plug", **{"": "p"}), "'p' has no memberName, by which a plug is matched"),
        (
            terminal_xml("t", "plug", a="p").replace("</Terminal>", "")
            + '<TerminalMemberVariable variableName="y" memberName="a" variableKind="signal"/></Terminal>',
            "2 members have the memberName 'a' (lines 1, 1): it must be unique",
        ),
        (terminal_xml("t", "bus", p="p") * 2, "there are two of this name, at the lines 1 and 1: names are unique"),
        (terminal_xml("t", "plug", "_handover_pose", p="p", q="y"), "y is real m, but a pose has a position"),
        ('<Terminal name="t"/>', "attribute 'matchingRule' is required but missing"),
        ("<?xml version='1.0'?><terminals/>", "begins with <terminals>; it must be <fmiTerminalsAndIcons>"),
        ("<?xml version='1.0'?><!DOCTYPE a><a/>", "terminalsAndIcons.xml cannot be read: it has a document type"),
        ("<?xml version='1.0'?><a>", "terminalsAndIcons.xml cannot be read: it is not well-formed"),
    ],
)
def test_what_breaks_the_standard_is_told_and_keeps_no_unit_from_being_described(
    tmp_path: Path, terminals: str, wanted: str
):
    file = unit(tmp_path, terminals)
    assert wanted in found(file)
    assert set(describe_fmu(file).outputs) == {"p", "y"}


@pytest.mark.parametrize(
    ("terminals", "wanted"),
    [
        (
            terminal_xml("t", "org.example.rule", p="p"),
            "its matching rule is 'org.example.rule'; plug, bus and sequence",
        ),
        (
            terminal_xml("t", "plug", p="p").replace(
                "</Terminal>",
                '<TerminalStreamMemberVariable inStreamMemberName="a" outStreamMemberName="b" '
                'inStreamVariableName="u" outStreamVariableName="y"/></Terminal>',
            ),
            "it has stream variables: connect their ports one by one",
        ),
    ],
)
def test_what_the_standard_allows_and_is_not_connected_here_is_a_note(tmp_path: Path, terminals: str, wanted: str):
    file = unit(tmp_path, terminals)
    assert found(file) == ""
    assert wanted in found(file, Level.NOTE)
    assert wanted in describe_fmu(file).terminals.by_name["t"].reason
