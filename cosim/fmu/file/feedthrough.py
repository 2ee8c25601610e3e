"""Which outputs of an FMU depend directly on which inputs, by its ModelStructure, in a run and at its start.

ModelStructure speaks of variables, and several can be one value: FMI 2's aliases share a value reference, which is
unique only within a base type, as the standard's functions are (FMI 2.0.4, sec. 2.2.7). So an output depends on
whatever any of its aliases is said to depend on. Of an output that no dependencies are given for, as of one that is not
listed at all, all inputs are presumed.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from handover.cosim.blocks.variable import Causality

if TYPE_CHECKING:
    from handover.cosim.fmu.file.description import FmuPort
    from handover.cosim.fmu.file.fmpy_edge import ModelDescription, ModelVariable

_Dependencies = dict[str, tuple[str, ...]]
_Key = tuple[str, int]
"""What two variables have in common that are one value."""


@dataclass(frozen=True)
class Feedthrough:
    """The inputs that outputs depend on directly: declared ones and presumed ones, in a run and at its start."""

    declared: _Dependencies
    presumed: _Dependencies
    initially_declared: _Dependencies
    initially_presumed: _Dependencies


def feedthrough_of(md: "ModelDescription", ports: Iterable["FmuPort"]) -> Feedthrough:
    """Return what an FMU's output ports depend on."""
    structure = _Structure(ports, is_fmi2=md.fmiVersion == "2.0")
    declared, presumed, listed = structure.dependencies(md.outputs)
    presumed |= structure.unlisted(md.modelVariables, listed)
    initially, presumed_initially, listed = structure.dependencies(md.initialUnknowns)
    listed_initially = {y for key in listed for y in structure.outputs[key]}
    for y in structure.aliases_of_inputs:
        declared[y] |= structure.aliases_of_inputs[y]
    for y, us in declared.items():
        initially[y] |= us
    return Feedthrough(
        _sorted(declared),
        structure.on_all_inputs(presumed),
        _sorted(initially),
        structure.on_all_inputs(presumed_initially | (presumed - listed_initially)),
    )


class _Structure:
    """An FMU's ports by what identifies their values."""

    def __init__(self, ports: Iterable["FmuPort"], *, is_fmi2: bool) -> None:
        self._is_fmi2 = is_fmi2
        self.outputs: dict[_Key, list[str]] = defaultdict(list)
        self._inputs: dict[_Key, list[str]] = defaultdict(list)
        self._all_inputs: tuple[str, ...] = ()
        of_causality = {Causality.OUTPUT: self.outputs, Causality.INPUT: self._inputs}
        for port in ports:
            if (names := of_causality.get(port.causality)) is not None:
                for reference in port.references:
                    names[self._key(port.fmi_type, reference)].append(port.name)
        self._all_inputs = tuple(sorted({u for us in self._inputs.values() for u in us}))
        self.aliases_of_inputs: dict[str, set[str]] = defaultdict(set)
        for key in self.outputs.keys() & self._inputs.keys():
            for y in self.outputs[key]:
                self.aliases_of_inputs[y].update(self._inputs[key])

    def _key(self, fmi_type: str, reference: int) -> _Key:
        if not self._is_fmi2:
            return "", reference
        return "Integer" if fmi_type == "Enumeration" else fmi_type, reference

    def _key_of(self, v: "ModelVariable") -> _Key:
        return self._key(v.type, v.valueReference)

    def dependencies(self, unknowns: Iterable[Any]) -> tuple[dict[str, set[str]], set[str], set[_Key]]:
        """Return the declared dependencies by output, the outputs without any, and which outputs' values are listed."""
        declared: dict[str, set[str]] = defaultdict(set)
        silent: set[str] = set()
        listed: set[_Key] = set()
        for unknown in unknowns:
            key = self._key_of(unknown.variable)
            outputs = self.outputs.get(key)
            if outputs is None:
                continue
            listed.add(key)
            if unknown.dependencies is None:
                silent.update(outputs)
                continue
            inputs = {u for d in unknown.dependencies for u in self._inputs.get(self._key_of(d), ())}
            for y in outputs:
                declared[y] |= inputs
        return declared, silent, listed

    def unlisted(self, variables: Iterable["ModelVariable"], listed: set[_Key]) -> set[str]:
        """Return the outputs with values that are not listed and not constant."""
        keys = (self._key_of(v) for v in variables if v.causality == "output" and v.variability != "constant")
        return {y for key in keys if key not in listed for y in self.outputs.get(key, ())}

    def on_all_inputs(self, outputs: set[str]) -> _Dependencies:
        """Return dependencies of the outputs on all inputs there are."""
        return dict.fromkeys(sorted(outputs), self._all_inputs) if self._all_inputs else {}


def _sorted(dependencies: Mapping[str, set[str]]) -> _Dependencies:
    return {y: tuple(sorted(us)) for y, us in dependencies.items() if us}
