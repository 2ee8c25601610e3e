"""The command `handover info`: what is in an FMU or an SSP, from any tool, without loading it."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import click

from handover.cosim.exceptions import counted
from handover.cosim.fmu.file.archive import FmuArchive
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.fmu.file.fmpy_edge import platforms_in
from handover.cosim.fmu.file.terminals import FmuTerminal
from handover.cosim.ssp.ssp_file import SspFile
from handover.cosim.system.system import System
from handover.scenarios.cli.console import open_console, print_json, print_rows
from handover.scenarios.cli.options import PATH
from handover.scenarios.cli.summaries.port_tables import port_rows, variable_data
from handover.scenarios.runs.execution.errors import UsageError, one_line_errors
from handover.scenarios.runs.execution.fmu_run import is_fmu
from handover.scenarios.runs.execution.selection import folder_fault, nothing_at
from handover.scenarios.runs.execution.ssp_run import is_ssp

_HELP = """Show what is in FILE, an FMU (2.0 or 3.0, co-simulation) or an SSP: names, steps, capabilities, parameters,
inputs, outputs and terminals; of an SSP its units, parameters and connections. Nothing is loaded or run; `handover
check` does that.
"""

_CAPABILITIES = {
    "varies_step": "its step may vary",
    "saves_state": "its state can be saved",
    "serialises_state": "its state can be kept as bytes",
    "interpolates_inputs": "it takes derivatives of inputs",
    "directional_derivatives": "it gives directional derivatives",
    "event_mode": "it has event mode",
    "returns_early": "it may return early from a step",
    "once_per_process": "a process can hold one instance",
}


@click.command("info", help=_HELP, short_help="Show what is in an FMU or an SSP, from any tool.")
@click.argument("file", type=PATH, metavar="FILE.fmu|FILE.ssp")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON, for programs.")
def info(file: Path, *, as_json: bool) -> None:
    """Show what is in an FMU or an SSP."""
    if not is_fmu(str(file)) and not is_ssp(str(file)):
        if not file.exists():
            raise UsageError(f"{file}: {nothing_at(file)}")
        if file.is_dir():
            raise UsageError(f"{file}: {folder_fault(file)}")
        right = "expected a file that ends with .fmu, .ssp or .ssd, or its unpacked folder; of units and scenarios, see"
        right += " `handover list`"
        raise UsageError(f"{file}: {right}")
    with one_line_errors():
        if is_ssp(str(file)):
            with SspFile(file) as ssp:
                stop = None if ssp.stop is None else float(ssp.stop)
                data = system_data(ssp.name, stop, ssp.system, ssp.parameters.values())
                print_json(data) if as_json else _print_system(data, ssp.parameters.values())
            return
        described = describe_fmu(file)
        data = fmu_data(described, platforms_in(FmuArchive(file)))
        print_json(data) if as_json else _print_fmu(data, described)


def fmu_data(d: FmuDescription, platforms: list[str]) -> dict[str, Any]:
    """Return what an FMU declares, as JSON can hold it; times are in seconds."""
    capabilities = {name: bool(getattr(d.capabilities, name)) for name in _CAPABILITIES}
    ports = {"parameters": d.parameters, "inputs": d.inputs, "outputs": d.outputs}
    return {
        "name": d.name,
        "fmi": d.fmi,
        "identifier": d.identifier,
        "token": d.token,
        "platforms": platforms,
        "step": None if d.step is None else float(d.step),
        "stop": d.experiment.stop,
        "sampled": d.sampled,
        "capabilities": capabilities,
        **{kind: [variable_data(p) for p in of_kind.values()] for kind, of_kind in ports.items()},
        "terminals": [terminal_data(t) for t in d.terminals.by_name.values()],
        "fault": d.untouched_fault or None,
    }


def terminal_data(t: FmuTerminal) -> dict[str, Any]:
    """Return a terminal as JSON can hold it: members by name; `fault` says why it cannot be connected."""
    return {
        "name": t.name,
        "kind": t.kind or None,
        "rule": t.rule.value if t.rule else None,
        "members": [{"name": m.name or None, "port": m.port} for m in t.members],
        "fault": t.reason or None,
    }


def system_data(name: str, stop: float | None, system: System, parameters: Iterable[FmuPort]) -> dict[str, Any]:
    """Return an SSP's units, parameters and connections, as JSON can hold them; times are in seconds."""
    units = {
        unit: {"model": u.description.name, "fmi": u.description.fmi, "step": float(u.period), "sampled": u.sampled}
        for unit, u in system.units.items()
    }
    connections = [[str(c.source), str(c.target)] for c in system.connections]
    rows = [variable_data(p) for p in parameters]
    return {"name": name, "stop": stop, "units": units, "parameters": rows, "connections": connections}


def _print_fmu(data: dict[str, Any], d: FmuDescription) -> None:
    console = open_console()
    console.print(f"{data['name']}: an FMU of FMI {data['fmi']}.0", style="bold", markup=False)
    step = "none" if data["step"] is None else f"{1000 * data['step']:.4g} ms"
    able = [sentence for name, sentence in _CAPABILITIES.items() if data["capabilities"][name]]
    rows = [
        ("step", f"{step}{', at which it samples' if data['sampled'] else ' is proposed' if data['step'] else ''}"),
        ("stop time", "none" if data["stop"] is None else f"{data['stop']:g} s"),
        ("platforms", ", ".join(data["platforms"]) or "none"),
        ("capabilities", "; ".join(able) or "none of those that are optional"),
        ("token", data["token"]),
    ]
    rows += [("fault", fault) for fault in (data["fault"], d.terminals.fault) if fault]
    print_rows(console, rows)
    for heading, ports in (("Parameters", d.parameters), ("Inputs", d.inputs), ("Outputs", d.outputs)):
        if ports:
            console.print(heading, style="bold")
            print_rows(console, port_rows(ports.values()))
    if data["terminals"]:
        console.print("Terminals", style="bold")
        print_rows(console, [_terminal_row(t) for t in data["terminals"]])


def _terminal_row(t: dict[str, Any]) -> tuple[str, ...]:
    members = [m["port"] if m["name"] in (m["port"], None) else f"{m['name']} = {m['port']}" for m in t["members"]]
    return t["name"], t["kind"] or "", t["rule"] or "", t["fault"] or ", ".join(members)


def _print_system(data: dict[str, Any], parameters: Collection[FmuPort]) -> None:
    console = open_console()
    stop = "no stop time" if data["stop"] is None else f"until {data['stop']:g} s"
    console.print(
        f"{data['name']}: a system of {counted(len(data['units']), 'unit')}, {stop}", style="bold", markup=False
    )
    console.print("Units", style="bold")
    units = data["units"].items()
    print_rows(console, [(n, u["model"], f"FMI {u['fmi']}.0", f"{1000 * u['step']:.4g} ms") for n, u in units])
    if parameters:
        console.print("Parameters, which -p of `handover run` sets", style="bold")
        print_rows(console, port_rows(parameters))
    if data["connections"]:
        console.print("Connections", style="bold")
        print_rows(console, [(source, "->", target) for source, target in data["connections"]])
