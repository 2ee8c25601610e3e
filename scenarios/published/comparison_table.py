"""A table of published values beside the campaign's."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ComparisonTable:
    """Rows of texts below a header of as many.

    Attributes:
        title: what it compares.
        header: names of the columns; the first column names what a row is of.
        rows: texts; "" where there is nothing to tell.
        note: how its figures were made, in sentences.

    Raises:
        ValueError: a row is longer or shorter than the header.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.header):
                raise ValueError(f"{self.title}: row {list(row)} has {len(row)} cells, the header {len(self.header)}")
