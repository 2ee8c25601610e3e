"""A variable of a model description of either standard, as it is written: nothing in it has been validated."""

from collections.abc import Mapping
from dataclasses import dataclass

from handover.cosim.fmu.file.xml import XmlElement

REALS = ("Real", "Float32", "Float64")
_SIGNED = {"Integer": 32, "Int8": 8, "Int16": 16, "Int32": 32, "Int64": 64, "Enumeration": 64}
_UNSIGNED = {"UInt8": 8, "UInt16": 16, "UInt32": 32, "UInt64": 64}
_FMI2_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")


@dataclass(frozen=True)
class DescribedVariable:
    """A variable's element and the element that holds its values' attributes: a child in FMI 2, itself in FMI 3."""

    element: XmlElement
    values: XmlElement

    @property
    def name(self) -> str:
        """Its name."""
        return self.element.get("name")

    @property
    def type(self) -> str:
        """Its FMI type, such as `Real` or `Float64`."""
        return self.values.tag

    @property
    def where(self) -> str:
        """Its name and line, for messages."""
        return f"variable {self.name!r} (line {self.element.line})"

    @property
    def causality(self) -> str:
        """Its causality, `local` where none is given."""
        return self.element.get("causality", "local")

    @property
    def reference(self) -> str:
        """Its value reference, as it is written."""
        return self.element.get("valueReference")

    @property
    def starts(self) -> tuple[str, ...] | None:
        """Its start values as they are written, one an entry of an array; None where none are given."""
        elements = [e.get("value") for e in self.values.named("Start")]
        if elements:
            return tuple(elements)
        given = self.values.get("start")
        if not given and "start" not in self.values.attributes:
            return None
        return (given,) if self.type in ("String", "Binary") else tuple(given.split()) or ("",)

    def parsed(self, text: str) -> float | int | str:
        """Return a value of this variable's type.

        Raises:
            ValueError: the text is not one; the message says what would be.
        """
        if self.type in REALS:
            return _real(text)
        if self.type == "Boolean":
            if text not in ("true", "false", "1", "0"):
                raise ValueError(f"{text!r} is not a boolean: expected true, false, 1 or 0")
            return int(text in ("true", "1"))
        if self.type in _SIGNED or self.type in _UNSIGNED:
            return _integer(text, self.type)
        if self.type == "Binary":
            try:
                return bytes.fromhex(text).hex()
            except ValueError:
                raise ValueError(f"{text[:40]!r} is not binary: expected pairs of hexadecimal digits") from None
        return text

    def shape(self, starts_of: Mapping[str, str]) -> tuple[int, ...] | None:
        """Return the dimensions, with those that are structural parameters at their start values; None if unknown."""
        sizes: list[int] = []
        for d in self.element.named("Dimension"):
            text = d.attributes.get("start", starts_of.get(d.get("valueReference"), ""))
            if not text.isdecimal():
                return None
            sizes.append(int(text))
        return tuple(sizes)


def variables_of(root: XmlElement, fmi: int) -> list[DescribedVariable]:
    """Return the variables of a model description."""
    if fmi == 3:
        return [DescribedVariable(e, e) for group in root.named("ModelVariables") for e in group.children]
    found: list[DescribedVariable] = []
    for element in root.named("ModelVariables", "ScalarVariable"):
        values = next((c for c in element.children if c.tag in _FMI2_TYPES), None)
        if values is not None:
            found.append(DescribedVariable(element, values))
    return found


def _real(text: str) -> float:
    try:
        if "_" in text:
            raise ValueError
        return float(text)
    except ValueError:
        raise ValueError(f"{text[:40]!r} is not a number, such as 0.5 or 1e-3") from None


def _integer(text: str, fmi_type: str) -> int:
    signed = fmi_type in _SIGNED
    bits = _SIGNED[fmi_type] if signed else _UNSIGNED[fmi_type]
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    digits = text[1:] if text[:1] in ("-", "+") else text
    if not (digits.isascii() and digits.isdecimal() and len(digits) < 40):
        raise ValueError(f"{text[:40]!r} is not a whole number")
    if not low <= int(text) <= high:
        raise ValueError(f"{text[:40]} does not fit {fmi_type}: expected a number from {low} to {high}")
    return int(text)
