"""Small blocks with answers known in closed form, built as FMUs by the tests of the master."""

import enum
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Int8, Raster, Single, UInt16, UInt64, Vector2, output, parameter, port
from handover.cosim.blocks.units import Kilogram, Metre, MetrePerSecond, Newton, NewtonPerMetre, Number

TinyPicture = Annotated[NDArray[np.uint8], Raster(4, 2)]


class Light(enum.IntEnum):
    RED = 1
    GREEN = 2


class Plain:
    """Without feedthrough and period of its own; all of it is its state."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def get_state(self) -> bytes:
        return pickle.dumps(vars(self))

    def set_state(self, state: bytes) -> None:
        vars(self).update(pickle.loads(state))


@dataclass(frozen=True, kw_only=True)
class NoParams:
    pass


@dataclass(kw_only=True)
class NoInputs:
    pass


@dataclass(frozen=True, kw_only=True)
class MassParams:
    m: Kilogram = parameter(1.0, "mass", minimum=0.001, maximum=100.0)
    x_0: Metre = parameter(1.0, "position at the start")


@dataclass(kw_only=True)
class MassInputs:
    f: Newton = port(0.0, "force")


@dataclass(kw_only=True)
class MassOutputs:
    x: Metre = output("position")
    v: MetrePerSecond = output("speed")


class Mass(Plain):
    """Moves by m x'' = f, exactly for a force that is held over the step."""

    def __init__(self, params: MassParams) -> None:
        self.m, self.x, self.v = params.m, params.x_0, 0.0

    def outputs(self, t: float, u: MassInputs) -> MassOutputs:  # noqa: ARG002
        return MassOutputs(x=self.x, v=self.v)

    def step(self, t: float, dt: float, u: MassInputs) -> MassOutputs:
        a = u.f / self.m
        self.x += self.v * dt + a * dt * dt / 2
        self.v += a * dt
        return self.outputs(t + dt, u)


@dataclass(frozen=True, kw_only=True)
class SpringParams:
    k: NewtonPerMetre = parameter(4.0, "stiffness", minimum=0.0)


@dataclass(kw_only=True)
class SpringInputs:
    x: Metre = port(0.0, "stretch")


@dataclass(kw_only=True)
class SpringOutputs:
    f: Newton = output("force")


class Spring(Plain):
    """A spring, f = -k x, with direct feedthrough."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"f": ("x",)}

    def __init__(self, params: SpringParams) -> None:
        self.k = params.k

    def outputs(self, t: float, u: SpringInputs) -> SpringOutputs:  # noqa: ARG002
        return SpringOutputs(f=-self.k * u.x)

    def step(self, t: float, dt: float, u: SpringInputs) -> SpringOutputs:  # noqa: ARG002
        return self.outputs(t, u)


@dataclass(frozen=True, kw_only=True)
class CounterParams:
    fails_at: int = parameter(10**6, "count at which it raises", minimum=1)


CounterInputs = NoInputs


@dataclass(kw_only=True)
class CounterOutputs:
    n: int = output("number of steps")
    at: Number = output("time at the end of the last step")
    odd: bool = output("whether the number is odd")
    light: Light = output("green after an odd number")
    pair: Vector2[Number] = output("number and its square")
    picture: TinyPicture = output("all pixels have the number as their value")


class Counter(Plain):
    """Counts its steps, with outputs of all kinds."""

    def __init__(self, params: CounterParams) -> None:
        self.fails_at, self.n = params.fails_at, 0

    def outputs(self, t: float, u: CounterInputs) -> CounterOutputs:  # noqa: ARG002
        n = self.n
        odd = n % 2 == 1
        return CounterOutputs(
            n=n,
            at=t,
            odd=odd,
            light=Light.GREEN if odd else Light.RED,
            pair=np.array([n, n * n], dtype=np.float64),
            picture=np.full((2, 4, 3), n % 256, dtype=np.uint8),
        )

    def step(self, t: float, dt: float, u: CounterInputs) -> CounterOutputs:
        self.n += 1
        if self.n == self.fails_at:
            raise RuntimeError(f"count {self.n} was asked to fail")
        return self.outputs(t + dt, u)


@dataclass(kw_only=True)
class EchoInputs:
    n: int = port(0, "a number")
    odd: bool = port(False, "a truth")
    light: Light = port(Light.RED, "a light")
    pair: Vector2[Number] = port(np.zeros(2), "two numbers")
    picture: TinyPicture = port(np.zeros((2, 4, 3), dtype=np.uint8), "a picture")


@dataclass(kw_only=True)
class EchoOutputs:
    n_back: int = output("the number")
    odd_back: bool = output("the truth")
    light_back: Light = output("the light")
    pair_back: Vector2[Number] = output("the numbers")
    brightness: Number = output("mean of the picture's pixels")


class Echo(Plain):
    """Passes its input on, with direct feedthrough."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "n_back": ("n",),
        "odd_back": ("odd",),
        "light_back": ("light",),
        "pair_back": ("pair",),
        "brightness": ("picture",),
    }

    def __init__(self, params: NoParams) -> None: ...

    def outputs(self, t: float, u: EchoInputs) -> EchoOutputs:  # noqa: ARG002
        return EchoOutputs(
            n_back=u.n,
            odd_back=u.odd,
            light_back=u.light,
            pair_back=np.array(u.pair),
            brightness=float(u.picture.mean()),
        )

    def step(self, t: float, dt: float, u: EchoInputs) -> EchoOutputs:  # noqa: ARG002
        return self.outputs(t, u)


@dataclass(frozen=True, kw_only=True)
class PickyParams:
    low: Number = parameter(0.0, "lower bound")
    high: Number = parameter(1.0, "upper bound")


class Picky(Counter):
    """Takes no bounds that are the wrong way round."""

    def __init__(self, params: PickyParams) -> None:
        if params.low >= params.high:
            raise ValueError(f"low = {params.low} must be below high = {params.high}")
        super().__init__(CounterParams())


@dataclass(kw_only=True)
class PushedOutputs:
    x: Metre = output("position")
    a: Number = output("force over mass, by direct feedthrough")


class Pushed(Mass):
    """A mass that also has its acceleration as an output, with direct feedthrough from the force."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"a": ("f",)}

    def outputs(self, t: float, u: MassInputs) -> PushedOutputs:  # type: ignore[override]  # noqa: ARG002
        return PushedOutputs(x=self.x, a=u.f / self.m)

    def step(self, t: float, dt: float, u: MassInputs) -> PushedOutputs:  # type: ignore[override]
        super().step(t, dt, u)
        return self.outputs(t + dt, u)


@dataclass(frozen=True, kw_only=True)
class DiaryParams:
    mark: str = parameter("a", "what it writes")


@dataclass(kw_only=True)
class DiaryInputs:
    heard: str = port("", "a text")


@dataclass(kw_only=True)
class DiaryOutputs:
    text: str = output("mark and the end of what it heard at each step; longer from step to step")
    pages: int = output("number of characters")


class Diary(Plain):
    """Writes down what it hears."""

    def __init__(self, params: DiaryParams) -> None:
        self.mark, self.text = params.mark, ""

    def outputs(self, t: float, u: DiaryInputs) -> DiaryOutputs:  # noqa: ARG002
        return DiaryOutputs(text=self.text, pages=len(self.text))

    def step(self, t: float, dt: float, u: DiaryInputs) -> DiaryOutputs:
        self.text += f"{self.mark}{u.heard[-7:]}é"
        return self.outputs(t + dt, u)


@dataclass(frozen=True, kw_only=True)
class TallyParams:
    factor: int = parameter(3, "by which the numbers grow", minimum=-10, maximum=10)


@dataclass(kw_only=True)
class TallyInputs:
    small: Int8 = port(0, "a small number")
    whole: UInt64 = port(0, "a large number")
    single: Single[Number] = port(0.0, "a number of low precision")
    double: Number = port(0.0, "a number")


@dataclass(kw_only=True)
class TallyOutputs:
    power: int = output("power of the factor by the number of steps")
    positive: UInt16 = output("its absolute value, of which the last digits only")
    third: Number = output("a third of it")
    single_third: Single[Number] = output("a third of it")
    heard: Number = output("sum of the inputs")


class Tally(Plain):
    """Gives numbers of many widths that grow from step to step."""

    def __init__(self, params: TallyParams) -> None:
        self.factor, self.power, self.heard = params.factor, 1, 0.0

    def outputs(self, t: float, u: TallyInputs) -> TallyOutputs:  # noqa: ARG002
        third = self.power / 3
        return TallyOutputs(
            power=self.power, positive=abs(self.power) % 50000, third=third, single_third=third, heard=self.heard
        )

    def step(self, t: float, dt: float, u: TallyInputs) -> TallyOutputs:
        self.power *= self.factor
        self.heard = u.small + u.whole + u.single + u.double
        return self.outputs(t + dt, u)


Photo = Annotated[NDArray[np.uint8], Raster(640, 480)]


@dataclass(kw_only=True)
class CameraOutputs:
    photo: Photo = output("pixels that differ, also from those of the step before")


class Camera(Plain):
    """Gives large pictures."""

    def __init__(self, params: NoParams) -> None:  # noqa: ARG002
        self.n = 0

    def outputs(self, t: float, u: CounterInputs) -> CameraOutputs:  # noqa: ARG002
        pixels = np.arange(640 * 480 * 3, dtype=np.uint32) * (self.n + 1)
        return CameraOutputs(photo=pixels.astype(np.uint8).reshape(480, 640, 3))

    def step(self, t: float, dt: float, u: CounterInputs) -> CameraOutputs:
        self.n += 1
        return self.outputs(t + dt, u)


@dataclass(kw_only=True)
class ViewerInputs:
    photo: Photo = port(np.zeros((480, 640, 3), dtype=np.uint8), "a picture")


@dataclass(kw_only=True)
class ViewerOutputs:
    weight: Number = output("the pixels, each times its place")


class Viewer(Plain):
    """Looks at every pixel of a large picture."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"weight": ("photo",)}

    def __init__(self, params: NoParams) -> None: ...

    def outputs(self, t: float, u: ViewerInputs) -> ViewerOutputs:  # noqa: ARG002
        return ViewerOutputs(weight=float(u.photo.ravel() @ np.arange(640 * 480 * 3, dtype=np.float64)))

    def step(self, t: float, dt: float, u: ViewerInputs) -> ViewerOutputs:  # noqa: ARG002
        return self.outputs(t, u)
