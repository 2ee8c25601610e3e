import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
import pytest

from cosim.block import Causality, DeclarationError, Kind, Variable, describe
from cosim.ports import BLACK_1280X720, Picture1280x720, Vector3, output, parameter, port
from cosim.units import Metre, Newton


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

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(phase=Phase.CLOSED if u.f_G[2] > 0 else Phase.OPEN)


def by_name(block: type[Any]) -> dict[str, Variable]:
    return {v.name: v for v in describe(block).variables}


def test_units_shapes_and_starts_are_read_off_the_declarations():
    v = by_name(Gripper)
    assert (v["d"].unit.symbol, v["d"].start, v["d"].minimum) == ("m", 0.035, 0.0)
    assert (v["gain"].shape, v["gain"].kind) == ((3,), Kind.REAL)
    assert v["gain"].start.tolist() == [1.0, 2.0, 3.0]
    assert (v["f_G"].unit.symbol, v["f_G"].causality) == ("N", Causality.INPUT)
    assert v["phase"].enumeration is Phase
    assert v["seed"].kind is Kind.INTEGER


def test_a_picture_says_its_size():
    left = by_name(Gripper)["left"]
    assert left.raster is not None
    assert left.raster.size == 1280 * 720 * 3
    assert left.raster.mime == "image/x-raw-bgr; width=1280; height=720"


def test_array_defaults_are_not_shared():
    a, b = Params(), Params()
    a.gain[0] = 9.0
    assert b.gain[0] == 1.0


def test_a_field_without_declaration_is_refused():
    @dataclass
    class Bare:
        x: float = 0.0

    class Careless(Gripper):
        def __init__(self, params: Bare) -> None: ...

    Careless.__init__.__annotations__["params"] = Bare
    with pytest.raises(DeclarationError, match="declare it with"):
        describe(Careless)


def test_feedthrough_names_ports():
    class Wrong(Gripper):
        feedthrough = {"phase": ("f_X",)}

    with pytest.raises(DeclarationError, match="f_X"):
        describe(Wrong)


def test_a_block_without_what_a_block_has_is_refused():
    class Bare:
        feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    with pytest.raises(DeclarationError, match=r"Bare\.period"):
        describe(Bare)
