import dataclasses
import enum
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
import pytest
from support.wording import Wording

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.declarations import DeclarationError, declared_variables
from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import (
    BLACK_1280X720,
    Int8,
    Picture1280x720,
    Single,
    UInt64,
    Vector3,
    Width,
    output,
    parameter,
    port,
)
from handover.cosim.blocks.schedule import InvalidSchedule, Schedule
from handover.cosim.blocks.units import Metre, Newton
from handover.cosim.blocks.variable import Causality, Kind, Variable


class Phase(enum.IntEnum):
    OPEN = 0
    CLOSED = 1


@dataclass(frozen=True, kw_only=True)
class Params:
    d: Metre = parameter(0.035, "tendon radius", minimum=0.0)
    seed: int = parameter(0, "seed of the random numbers")
    gain: Vector3[Metre] = parameter(np.array([1.0, 2.0, 3.0]), "gain")


@dataclass(kw_only=True)
class Inputs:
    left: Picture1280x720 = port(BLACK_1280X720, "left picture")
    f_G: Vector3[Newton] = port(np.zeros(3), "force")


@dataclass(kw_only=True)
class Outputs:
    phase: Phase = output("phase")


class Gripper:
    """Closes when pushed."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"phase": ("f_G",)}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self.params = params

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(phase=Phase.CLOSED if u.f_G[2] > 0 else Phase.OPEN)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None: ...


def by_name(block: type[Any]) -> dict[str, Variable]:
    return {v.name: v for v in describe(block).variables}


def test_units_shapes_starts_and_pictures_are_read_off_the_declarations():
    v = by_name(Gripper)
    assert (v["d"].unit.symbol, v["d"].start, v["d"].minimum) == ("m", 0.035, 0.0)
    assert (v["gain"].shape, v["gain"].kind) == ((3,), Kind.REAL)
    assert v["gain"].start.tolist() == [1.0, 2.0, 3.0]
    assert (v["f_G"].unit.symbol, v["f_G"].causality) == ("N", Causality.INPUT)
    assert v["phase"].enumeration is Phase
    assert v["seed"].kind is Kind.INTEGER
    assert v["left"].raster is not None
    assert v["left"].raster.size == 1280 * 720 * 3
    assert v["left"].raster.mime == "image/x-raw-bgr; width=1280; height=720"
    a, b = Params(), Params()
    a.gain[0] = 9.0
    assert b.gain[0] == 1.0  # not shared


class Bare:
    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def step(self, t: float, dt: float, u: Inputs) -> Outputs: ...


@dataclass
class Undeclared:
    x: float = 0.0


def careless(self: Any, params: Undeclared) -> None: ...


def outputs(self: Any, t: float) -> Outputs: ...


def takes(self: Any, t: float, dt: float, u: Any) -> Outputs: ...


takes.__annotations__["u"] = dataclasses.make_dataclass("Made", [("x", Vector3[Metre], port(np.zeros(2), "x"))])


@pytest.mark.parametrize(
    "change",
    [
        None,
        {"__init__": careless},
        {"outputs": outputs},
        {"step": takes},
        {"period": 0.1},
        {"period": 2},
        {"period": "soon"},
        {"period": Fraction(0)},
        {"feedthrough": ("phase",)},
        {"feedthrough": {"phase": "f_G"}},
        {"feedthrough": {"phase": ("f_X",)}},
        {"feedthrough": {"phase": 3}},
    ],
    ids=lambda change: re.sub("<function (.*) at .*>", r"\1", str(change)),
)
def test_a_block_without_what_a_block_has_is_refused_where_it_is(change: dict[str, Any] | None, wording: Wording):
    with pytest.raises(DeclarationError) as e:
        describe(Bare if change is None else type("Wrong", (Gripper,), change))
    wording.check(re.sub(r"line \d+", "line N", str(e.value)))


def declared(hint: Any, field: Any) -> Variable:
    made = dataclasses.make_dataclass("Made", [("x", hint, field)])
    return declared_variables(made, Causality.INPUT)[0]


def test_reals_and_integers_have_64_bits_unless_a_type_says_otherwise():
    assert by_name(Gripper)["d"].width is by_name(Gripper)["gain"].width is Width.FLOAT64
    assert by_name(Gripper)["seed"].width is Width.INT64
    assert by_name(Gripper)["phase"].width is by_name(Gripper)["left"].width is None
    assert declared(Int8, port(3, "x")).width is Width.INT8
    for hint in (Single[Vector3[Metre]], Vector3[Single[Metre]]):
        v = declared(hint, port(np.full(3, 0.1), "x"))
        assert (v.width, v.shape, v.unit.symbol) == (Width.FLOAT32, (3,), "m")
        assert v.start.tolist() == [float(np.float32(0.1))] * 3  # what a host sees of it
    v = declared(Single[Metre], port(0.3, "x", minimum=0.1, maximum=0.3))
    assert (v.minimum, v.maximum, v.start) == tuple(float(np.float32(x)) for x in (0.1, 0.3, 0.3))


@pytest.mark.parametrize(
    ("hint", "field"),
    [
        (Int8, port(128, "x")),
        (Int8, port(0, "x", minimum=-129)),
        (UInt64, port(-1, "x")),
        (int, port(2**63, "x")),
        (Single[Metre], port(0.0, "x", maximum=1e39)),
        (Single[Vector3[Metre]], port(np.array([0.0, -1e39, 0.0]), "x")),
        (Metre, port(3.0, "x", maximum=2.0)),
        (Vector3[Metre], port(np.array([1.0, -1.0, 1.0]), "x", minimum=0.0)),
        (Phase, port(Phase.CLOSED, "x", maximum=0)),
        (Single[int], port(0, "x")),
        (Single[bool], port(start=False, description="x")),
        (Metre, port("abc", "x")),
        (Metre, port(None, "x")),
        (Metre, port(start=True, description="x")),
        (int, port(0.5, "x")),
        (bool, port(1, "x")),
        (str, port(1, "x")),
        (bytes, port("x", "x")),
        (Phase, port(1, "x")),
        (Vector3[Metre], port("abc", "x")),
        (Picture1280x720, port(np.zeros((2, 2, 3)), "x")),
        (Metre, port(3.0, "x", minimum=4.0, maximum=2.0)),
        (Metre, output("x", minimum=4.0, maximum=2.0)),
        (Metre, port(3.0, "x", maximum=float("nan"))),
        (Vector3[Int8], port(np.zeros(3), "x")),
    ],
)
def test_what_does_not_fit_its_type_is_refused(hint: Any, field: Any, wording: Wording):
    with pytest.raises(DeclarationError) as e:
        declared(hint, field)
    wording.check(e.value)


def test_a_name_that_fmi_does_not_know_is_refused(wording: Wording):
    with pytest.raises(DeclarationError) as e:
        declared_variables(dataclasses.make_dataclass("Made", [("größe", Metre, port(0.0, "x"))]), Causality.INPUT)
    wording.check(e.value)


class Hot(InvalidParameters):
    """Too hot."""

    block = "Oven"


def test_a_refusal_names_its_block_and_all_faults():
    refusal = Hot(["t = 900 must be at most 300", "door open"])
    assert str(refusal) == "Oven: t = 900 must be at most 300; door open"
    assert refusal.faults == ["t = 900 must be at most 300", "door open"]
    assert isinstance(refusal, ValueError)


def test_a_value_holds_from_its_time_on_which_is_met_by_the_sum_of_steps_that_comes_to_it():
    schedule = Schedule.parse("1.5:0.05  3:0.1", (1,), 0.0, 1.0)
    assert [schedule.at(t) for t in (0.0, 1.499, 1.5, 2.99, 3.0, 1e6)] == [None, None, (0.05,), (0.05,), (0.1,), (0.1,)]
    schedule = Schedule.parse("0.3:7", (1,), 0.0, 10.0)
    assert schedule.at(sum([0.1] * 3)) == schedule.at(0.3 - 1e-12) == (7.0,)
    assert Schedule.parse("0:1 2:3,4", (1, 2), 0.0, 9.0).values == ((1.0,), (3.0, 4.0))
    assert Schedule.parse("  ", (1,), 0.0, 1.0).at(5.0) is None


@pytest.mark.parametrize(
    "text",
    [
        "1:0.1,0.2", "1:0.1;2:0.2", "5", "a:1", "1:", "2:0.1 1:0.2", "2:0.1 2:0.2", "-1:0.1", "nan:0.1", "inf:0.1",
        "1:1.5", "1:nan",
    ],
)  # fmt: skip
def test_what_is_no_schedule_is_refused(text: str, wording: Wording):
    with pytest.raises(InvalidSchedule) as e:
        Schedule.parse(text, (1,), 0.0, 1.0)
    wording.check(e.value)
