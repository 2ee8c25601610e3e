"""The Python side of an FMU's instance: what the C runtime calls (runtime/slave.c)."""

from collections.abc import Callable
from typing import Any

from cosim.block import Block, describe
from fmus.buffers import Buffers, UnfitState, join, split
from fmus.exchange import input_reader, output_writer
from fmus.layout import Form, Layout
from fmus.parameters import read_parameters
from fmus.table import table

PERIOD_TOLERANCE = 1e-6
"""Relative; hosts add up step sizes, and write them as decimals."""


class UnfitStep(ValueError):
    """A sampled block was to make a step that is not its period."""

    is_refusal = True

    def __init__(self, block: str, dt: float, period: float) -> None:
        super().__init__(f"a step of {dt:.9g} s: {block} is sampled, each of its steps is its period, {period!r} s")
        self.dt, self.period = dt, period


class Slave:
    """One instance: a block, its buffers, and the way between them.

    The block is made from the parameters when outputs are first needed, and again if a parameter changed after that.

    Args:
        block: the block's class.
        form: a value of `Form`; it decides what a value reference stands for.
        memory: where the variables lie, see `Buffers`.
    """

    _block: Block

    def __init__(self, block: type[Any], form: str, memory: Callable[[int], Any] | None = None) -> None:
        self._type = block
        self._form = Form(form)
        description = describe(block)
        self._period = None if description.period is None else float(description.period)
        self._buffers = Buffers(Layout(description), memory)
        self._clock = self._buffers.floats[:2]
        self._read = input_reader(self._buffers)
        self._write = output_writer(self._buffers)
        self._made_from: bytes | None = None
        self._fresh = b""

    def table(self) -> bytes:
        """Return what the C runtime must know of the buffers."""
        return table(self._buffers, self._form)

    def initialise(self) -> None:
        """Work out the outputs at the start.

        However often a host asks while it initialises, the block starts from its fresh state each time: the outcome
        does not depend on the host's ways.

        Raises:
            ParameterOutOfRange: a parameter is outside its declared range.
        """
        if self._made_from == self._buffers.parameters():
            self._block.set_state(self._fresh)
        else:
            self._make()
        self._write(self._block.outputs(float(self._clock[0]), self._read()))

    def step(self) -> None:
        """Advance from t by dt, as the buffers have them, and write the outputs.

        Raises:
            UnfitStep: the block is sampled and dt is not its period; nothing has changed.
        """
        t, dt = self._clock.tolist()
        if self._period is not None and abs(dt - self._period) > PERIOD_TOLERANCE * self._period:
            raise UnfitStep(self._type.__name__, dt, self._period)
        self._write(self._block.step(t, dt, self._read()))

    def reset(self) -> None:
        """Go back to where a new instance is."""
        self._buffers.reset()
        self._made_from = None

    def get_state(self) -> bytes:
        """Return the variables, the time, and the block's state if there is a block that fits its parameters."""
        has_block = self._made_from == self._buffers.parameters()
        return join([self._buffers.to_bytes(), *([self._block.get_state()] if has_block else [])])

    def set_state(self, state: bytes) -> None:
        """Take over what `get_state` gave, here or in another instance.

        Raises:
            UnfitState: it is a state of another unit; nothing has changed.
            ParameterOutOfRange, UnknownItem: it has such a parameter; nothing has changed.
        """
        parts = split(state)
        if len(parts) not in (1, 2):
            raise UnfitState
        before = self._buffers.to_bytes()
        self._buffers.from_bytes(parts[0])
        if len(parts) == 1:
            self._made_from = None
            return
        if self._made_from != self._buffers.parameters():
            try:
                self._make()
            except BaseException:
                self._buffers.from_bytes(before)
                raise
        self._block.set_state(parts[1])

    def get_string(self, index: int) -> bytes:
        """Return a string variable as UTF-8; the bytes stay alive until the variable changes."""
        return self._buffers.strings[index]

    def set_string(self, index: int, value: bytes) -> None:
        """Set a string variable.

        Raises:
            UnicodeDecodeError: the bytes are not UTF-8.
        """
        value.decode()
        self._buffers.strings[index] = value

    def _make(self) -> None:
        """Make a block of the parameters; if that fails, the block of before stays, with what it was made from."""
        block: Block = self._type(read_parameters(self._buffers))
        self._fresh = block.get_state()
        self._block, self._made_from = block, self._buffers.parameters()
