"""A table of a plan that tells what is wrong with it: every fault of a plan is collected, by the place where it is."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, cast

from handover.cosim.exceptions import nearest

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

_T = TypeVar("_T")


class PlanTable:
    """A table, whose values are taken by name; names that nobody takes are faults.

    Where a value is wrong or missing, a fault is added to `faults` and a value of the right type is returned, so that
    the reader goes on and finds all of them.

    Attributes:
        where: its name with those of the tables around it, such as "text.en"; "" for the whole plan.
        faults: of the whole plan.
    """

    def __init__(self, where: str, content: Mapping[str, Any], faults: list[str]) -> None:
        self.where, self.faults = where, faults
        self._content, self._known, self._tables = content, list[str](), dict[str, PlanTable]()
        self._is_open = False

    def text(self, name: str) -> str:
        """Return a text that is not empty."""
        value = self._take(name)
        if isinstance(value, str) and value.strip():
            return value.strip()
        return self._wrong(name, value, "expected a non-empty string", "")

    def texts(self, name: str, *, empty: bool = False) -> list[str]:
        """Return a list of texts, which may have no entry only if `empty`."""
        value = self._take(name)
        texts: list[Any] = cast(list[Any], value) if isinstance(value, list) else []
        if isinstance(value, list) and (texts or empty) and all(isinstance(t, str) and t.strip() for t in texts):
            return [str(t).strip() for t in texts]
        return self._wrong(name, value, 'expected a list of non-empty strings, such as ["a", "b"]', [])

    def choice(self, name: str, valid: Sequence[str]) -> str:
        """Return one of some texts."""
        value = self._take(name)
        if isinstance(value, str) and value in valid:
            return value
        return self._wrong(name, value, f"expected {' or '.join(map(repr, valid))}", valid[0])

    def whole(self, name: str, low: int, high: int) -> int:
        """Return a whole number of a range."""
        value = self._take(name)
        if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high:
            return value
        return self._wrong(name, value, f"expected a whole number from {low} to {high}", low)

    def number(self, name: str, low: float, high: float) -> float:
        """Return a number of a range."""
        value = self._take(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high:
            return float(value)
        return self._wrong(name, value, f"expected a number from {low:g} to {high:g}", low)

    def flag(self, name: str, *, default: bool) -> bool:
        """Return true or false."""
        value = self._take(name, default)
        return value if isinstance(value, bool) else self._wrong(name, value, "expected true or false", default)

    def table(self, name: str, *, needed: bool = True) -> "PlanTable":
        """Return a table in it; an empty one where there is none, which is a fault if it is `needed`."""
        value = self._take(name, None if needed else {})
        if not isinstance(value, dict):
            value = self._wrong(name, value, f"expected a table: [{self._path(name)}]", dict[str, Any]())
        if name not in self._tables:
            self._tables[name] = PlanTable(self._path(name), cast(dict[str, Any], value), self.faults)
        return self._tables[name]

    def tables(self) -> dict[str, "PlanTable"]:
        """Return the tables in it by names of any kind that could be a column's."""
        for name in self._content:
            if not _NAME.fullmatch(name):
                self.faults.append(f"{self._path(name)}: a name has letters, digits and underscores")
        return {name: self.table(name) for name in self._content}

    def list_of_tables(self, name: str) -> list["PlanTable"]:
        """Return the tables of an array of them, such as [[questions]]; none where there is none."""
        value = self._take(name, [])
        entries: list[Any] = cast(list[Any], value) if isinstance(value, list) else []
        if not isinstance(value, list) or any(not isinstance(entry, dict) for entry in entries):
            entries = self._wrong(name, value, f"expected tables: [[{self._path(name)}]]", list[Any]())
        made = [PlanTable(f"{self._path(name)}[{k}]", entry, self.faults) for k, entry in enumerate(entries, 1)]
        self._tables |= {f"{name}[{k}]": table for k, table in enumerate(made, 1)}
        return made

    def parameters(self) -> dict[str, str]:
        """Return all it has as a scenario's parameters, which are texts."""
        self._is_open = True
        return {name: self._parameter(name, value) for name, value in self._content.items()}

    def texts_by_name(self, names: Sequence[str]) -> dict[str, str]:
        """Return a text for each of some names."""
        return {name: self.text(name) for name in names}

    def check_names(self) -> None:
        """Add a fault for each name in it, and in its tables, that was not taken."""
        if not self._is_open:
            for name in self._content:
                if name not in self._known:
                    self.faults.append(f"{self._path(name)}: no such key; {nearest(name, self._known)}")
        for table in self._tables.values():
            table.check_names()

    def _take(self, name: str, default: Any = None) -> Any:
        self._known.append(name)
        return self._content.get(name, default)

    def _wrong(self, name: str, value: Any, right: str, instead: _T) -> _T:
        what = "it is missing" if name not in self._content else f"it is {value!r:.60}"
        self.faults.append(f"{self._path(name)}: {what}; {right}")
        return instead

    def _path(self, name: str) -> str:
        return f"{self.where}.{name}" if self.where else name

    def _parameter(self, name: str, value: Any) -> str:
        entries: list[Any] = cast(list[Any], value) if isinstance(value, list) else [value]
        if any(not isinstance(v, (str, int, float)) or (isinstance(v, float) and math.isnan(v)) for v in entries):
            return self._wrong(name, value, "expected a string, a number, true, false or a list of them", "")
        return ",".join(_text_of(v) for v in entries)


def _text_of(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
