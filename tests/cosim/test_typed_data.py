from dataclasses import dataclass, field
from typing import Any

import pytest
from typing_extensions import TypedDict

from handover.cosim.typed_data import Count, ExactSeconds, InvalidData, NotNegative, Seed, decoded


class Described(TypedDict, total=False):
    time: NotNegative
    rows: Count
    every: ExactSeconds | None
    values: dict[str, float | None]
    other: dict[str, Any]


@dataclass
class Point:
    x: float
    names: list[str] = field(default_factory=list[str])


def test_an_object_is_what_is_declared_and_keeps_what_is_not():
    text = '{"time": 1, "rows": 3, "every": "1/30", "values": {"a": null, "b": 2}, "of another version": [1]}'
    read = decoded(text, Described)
    assert read == {
        "time": 1, "rows": 3, "every": "1/30", "values": {"a": None, "b": 2}, "of another version": [1],
    }  # fmt: skip
    assert decoded('{"x": 2, "y": 3}', Point) == Point(2.0)


@pytest.mark.parametrize(
    "text",
    [
        '{"time": "1"}', '{"time": -1e-9}', '{"time": 1e999}', '{"time": NaN}', '{"time": true}', '{"rows": 0.5}',
        '{"rows": -1}', '{"rows": 9223372036854775808}', '{"every": "1/0"}', '{"every": "-1"}', '{"every": "0/3"}',
        '{"every": "1e9"}', f'{{"every": "{"9" * 400}"}}', '{"values": {"a": "x"}}', '{"values": {"a": 1e999}}',
        '{"other": ' + "[" * 100000 + "]" * 100000 + "}", "[]", "{", "", "null", '{"other": {"a": "\udcff"}}',
    ],
)  # fmt: skip
def test_what_is_not_declared_is_refused(text: str):
    with pytest.raises(InvalidData):
        decoded(text.encode("utf-8", "surrogateescape"), Described)


def test_a_seed_has_63_bits():
    declared: Any = Seed
    assert decoded(str(2**63 - 1), declared) == 2**63 - 1
    for seed in ("-1", str(2**63), "1" * 310):
        with pytest.raises(InvalidData):
            decoded(seed, declared)
