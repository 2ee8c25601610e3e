"""References in a model description's ModelStructure that lead to no variable.

FMI 2 refers to variables by their places in ModelVariables, counted from 1, FMI 3 by their value references. A reader
that follows such a reference fails, or finds another variable; so a run and a check both tell it from here.
"""

from collections.abc import Collection, Iterator
from typing import NamedTuple

from handover.cosim.fmu.file.xml import XmlElement

_FMI3_UNKNOWNS = ("Output", "ContinuousStateDerivative", "ClockedState", "InitialUnknown", "EventIndicator")


class LostReference(NamedTuple):
    """A reference that leads to no variable: where it is, what is wrong, and what would be right."""

    where: str
    what: str
    cure: str

    @property
    def line(self) -> str:
        """All of it in one line."""
        return f"{self.where}: {self.what}; {self.cure}"


def lost_references(root: XmlElement, fmi: int) -> Iterator[LostReference]:
    """Yield the references of unknowns, and of what they depend on, that lead to no variable."""
    structure = list(root.named("ModelStructure"))
    if fmi == 2:
        count = len(list(root.named("ModelVariables", "ScalarVariable")))
        valid: Collection[str] = {str(i + 1) for i in range(count)}
        unknowns = [u for group in structure for part in group.children for u in part.named("Unknown")]
        key, cure = "index", f"there are variables 1 to {count}"
    else:
        valid = {v.get("valueReference") for group in root.named("ModelVariables") for v in group.children}
        unknowns = [u for group in structure for u in group.children if u.tag in _FMI3_UNKNOWNS]
        key, cure = "valueReference", "no variable has it"
    for u in unknowns:
        for name in (key, "dependencies"):
            for missing in (r for r in u.get(name).split() if r not in valid):
                yield LostReference(f"ModelStructure (line {u.line})", f"{name} {missing} leads to no variable", cure)
