"""The Python side of an FMU's instance: what the C runtime calls (runtime/slave.c)."""

import math
from collections.abc import Callable
from typing import Any

from handover.cosim.blocks.block import InvalidAdvance
from handover.cosim.blocks.description import describe
from handover.fmus.buffers import Buffers, InvalidState, join, split
from handover.fmus.exchange import derivative_reader, input_reader, output_writer
from handover.fmus.layout import Form, Layout
from handover.fmus.parameters import read_parameters
from handover.fmus.table import table


class Slave:
    """One instance: a block, its buffers, and the way between them.

    The block is made from the parameters when outputs are first needed, and again if a parameter changed after that.

    Args:
        block: the block's class.
        form: a value of `Form`; it decides what a value reference stands for.
        memory: where the variables lie, see `Buffers`.
    """

    _block: Any  # a handover.cosim.blocks.block.Block, perhaps also an EventfulBlock or a DifferentiableBlock

    def __init__(self, block: type[Any], form: str, memory: Callable[[int], Any] | None = None) -> None:
        self._type = block
        self._form = Form(form)
        description = describe(block)
        self._buffers = Buffers(Layout(description), memory)
        self._clock = self._buffers.floats[:2]
        self._read = input_reader(self._buffers)
        self._write = output_writer(self._buffers)
        self._made_from: bytes | None = None
        self._fresh = b""
        self._before_tick: bytes | None = None
        if description.has_derivatives:
            self._derive = derivative_reader(self._buffers)

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
        """Advance from t by dt, as the buffers have them, and write the outputs; a sampled block's dt is its period."""
        t, dt = self._clock.tolist()
        self._write(self._block.step(t, dt, self._read()))

    def evaluate(self) -> None:
        """Step as `step` does, but for trial: when called again, from the same state as at the first time."""
        t, dt = self._clock.tolist()
        u = self._read()
        if self._before_tick is None:
            self._before_tick = self._block.get_state()
        else:
            self._block.set_state(self._before_tick)
        self._write(self._block.step(t, dt, u))

    def settle(self) -> None:
        """Make the step that was last tried the one that was done."""
        self._before_tick = None

    def advance(self) -> None:
        """Advance from t by dt or to the first event, write the outputs, and how far it came in the place of dt.

        Raises:
            InvalidAdvance: the block says that it went backwards, or farther than dt.
        """
        t, dt = self._clock.tolist()
        reached, y = self._block.advance(t, dt, self._read())
        if not 0.0 <= reached <= dt:
            raise InvalidAdvance(self._type.__name__, reached, dt)
        self._write(y)
        self._clock[1] = reached

    def handle_event(self) -> None:
        """Change at t what an event changes, and write the outputs."""
        self._write(self._block.handle_event(float(self._clock[0]), self._read()))

    def next_event(self) -> None:
        """Write the time of the next event that is known beforehand, or infinity, in the place of dt."""
        following = self._block.next_event(float(self._clock[0]))
        self._clock[1] = math.inf if following is None else following

    def derivative(self, seed: bytes) -> bytes:
        """Return the real outputs' derivatives in a direction of the real inputs; float64, as in the buffers."""
        du, give = self._derive(seed)
        return give(self._block.directional_derivative(float(self._clock[0]), self._read(), du))

    def reset(self) -> None:
        """Go back to where a new instance is."""
        self._buffers.reset()
        self._made_from = self._before_tick = None

    def get_state(self) -> bytes:
        """Return the variables, the time, and the block's state if there is a block that fits its parameters.

        While a step is tried, that is the state before it.
        """
        parts = [self._buffers.to_bytes()]
        if self._made_from == self._buffers.parameters():
            parts.append(self._block.get_state() if self._before_tick is None else self._before_tick)
        return join(parts)

    def set_state(self, state: bytes) -> None:
        """Take over what `get_state` gave, here or in another instance.

        Raises:
            InvalidState: it is a state of another unit; nothing has changed.
            ParameterOutOfRange, UnknownItem: it has such a parameter; nothing has changed.
        """
        parts = split(state)
        if len(parts) not in (1, 2):
            raise InvalidState
        before = self._buffers.to_bytes()
        self._buffers.from_bytes(parts[0])
        if len(parts) == 1:
            self._made_from = self._before_tick = None
            return
        if self._made_from != self._buffers.parameters():
            try:
                self._make()
            except BaseException:
                self._buffers.from_bytes(before)
                raise
        self._before_tick = None
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
        block = self._type(read_parameters(self._buffers))
        self._fresh = block.get_state()
        self._block, self._made_from = block, self._buffers.parameters()
