"""A block with a port of every kind but pictures."""

import enum
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, output, parameter, port
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, SquareMetre


class Mood(enum.IntEnum):
    CALM = 0
    KEEN = 1
    WILD = 5


class Misfortune(RuntimeError):
    pass


@dataclass(frozen=True, kw_only=True)
class Params:
    gain: Number = parameter(2.0, "gain", minimum=0.0, maximum=10.0)
    p0: Vector3[Metre] = parameter(np.array([1.0, 2.0, 3.0]), "first place")
    n: int = parameter(3, "count", minimum=1)
    fast: bool = parameter(False, "whether to hurry")
    mood: Mood = parameter(Mood.KEEN, "mood")
    label: str = parameter('a<b&"c" 100% #1', "label")
    seed: int = parameter(0, "seed")


@dataclass(kw_only=True)
class Inputs:
    a: Number = port(0.5, "scalar")
    v: Vector3[MetrePerSecond] = port(np.array([0.1, -0.2, 0.3]), "velocity")
    M: Matrix3[SquareMetre] = port(np.eye(3), "matrix")
    k: int = port(1, "integer")
    on: bool = port(True, "switch")
    mood_in: Mood = port(Mood.CALM, "mood wanted")
    word: str = port("hello", "word")


@dataclass(kw_only=True)
class Outputs:
    b: Number = output("scalar")
    p: Vector3[Metre] = output("place")
    N: Matrix3[SquareMetre] = output("matrix")
    total: int = output("integer")
    off: bool = output("switch")
    mood_out: Mood = output("mood")
    sentence: str = output("words")
    c: Number = output("another scalar")


class EveryKind:
    """Moves by its velocity, p' = v, and adds noise. It fails when a is 666."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"b": ("a",), "N": ("M",), "off": ("on",)}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self.params = params
        self._random = np.random.default_rng(params.seed)
        self._p: Floats = params.p0.copy()
        self._total = 0

    def outputs(self, t: float, u: Inputs) -> Outputs:
        return Outputs(
            b=self.params.gain * u.a + t,
            p=self._p + self._random.normal(0.0, 1e-3, 3),
            N=2.0 * u.M,
            total=self._total,
            off=not u.on,
            mood_out=u.mood_in,
            sentence=f"{self.params.label} {u.word}",
            c=float(self.params.mood) + self.params.n,
        )

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if u.a == 666.0:
            raise Misfortune("the number of the beast # 100%")
        self._p = self._p + dt * u.v * (2.0 if self.params.fast else 1.0)
        self._total += u.k
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return pickle.dumps((self._p, self._total, self._random.bit_generator.state))

    def set_state(self, state: bytes) -> None:
        self._p, self._total, self._random.bit_generator.state = pickle.loads(state)
