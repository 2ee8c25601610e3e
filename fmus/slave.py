"""The Python side of an FMU's instance: what the C runtime calls (runtime/slave.c)."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from handover.cosim.blocks.block import InvalidAdvance, InvalidState
from handover.cosim.blocks.description import describe, with_start_values
from handover.fmus.buffers import Buffers, join, split
from handover.fmus.exchange import InvalidReturn, OtherReturn, derivative_reader, input_reader, output_writer
from handover.fmus.layout import Form, Layout
from handover.fmus.parameters import read_parameters
from handover.fmus.table import table


class Slave:
    """One instance: a block, its buffers, and the functions that move values between them.

    The block is made from the parameters when outputs are first needed, and again if a parameter has changed since.

    Args:
        block: the block's class.
        form: a value of `Form`; it determines the value references.
        start: start values that differ from those that the block declares, see `with_start_values`.
        memory: allocates the variables' memory, see `Buffers`.
    """

    _block: Any  # a handover.cosim.blocks.block.Block, perhaps also an EventfulBlock or a DifferentiableBlock

    def __init__(
        self,
        block: type[Any],
        form: str,
        start: Mapping[str, Any],
        memory: Callable[[int], Any] | None = None,
    ) -> None:
        self._type = block
        self._form = Form(form)
        description = with_start_values(describe(block), start)
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
        """Return the table that describes the buffers to the C runtime, see `handover.fmus.table`."""
        return table(self._buffers, self._form)

    def initialise(self) -> None:
        """Compute the outputs at the start.

        The block starts from its fresh state each time, so that the result does not depend on how often a host gets
        outputs while it initialises.

        Raises:
            ParameterOutOfRange: a parameter is outside its declared range.
        """
        if self._made_from == self._buffers.parameters():
            self._block.set_state(self._fresh)
        else:
            self._make()
        try:
            self._write(self._block.outputs(float(self._clock[0]), self._read()))
        except InvalidReturn as e:
            raise e.by(self._block.outputs) from e.__cause__

    def step(self) -> None:
        """Step from t by dt, which are in the buffers, and write the outputs; a sampled block's dt is its period."""
        t, dt = self._clock.tolist()
        self._step(t, dt, self._read())

    def _step(self, t: float, dt: float, u: Any) -> None:
        try:
            self._write(self._block.step(t, dt, u))
        except InvalidReturn as e:
            raise e.by(self._block.step) from e.__cause__

    def evaluate(self) -> None:
        """Step as `step` does, but tentatively: called again, it steps from the same state as the first time."""
        t, dt = self._clock.tolist()
        u = self._read()
        if self._before_tick is None:
            self._before_tick = self._block.get_state()
        else:
            self._block.set_state(self._before_tick)
        self._step(t, dt, u)

    def settle(self) -> None:
        """Make the last tentative step the actual one."""
        self._before_tick = None

    def advance(self) -> None:
        """Advance from t by dt or to the first event; write the outputs and, in the place of dt, how far it advanced.

        Raises:
            InvalidAdvance: by the block's return value it went backwards, or farther than dt.
        """
        t, dt = self._clock.tolist()
        returned: Any = self._block.advance(t, dt, self._read())
        try:
            if not isinstance(returned, tuple) or len(returned) != 2:
                raise OtherReturn(returned, "the time by which it advanced and its outputs, such as (dt, Outputs(...))")
            reached, y = returned
            if not 0.0 <= reached <= dt:
                raise InvalidAdvance(self._type.__name__, reached, dt)
            self._write(y)
        except InvalidReturn as e:
            raise e.by(self._block.advance) from e.__cause__
        self._clock[1] = reached

    def handle_event(self) -> None:
        """Let the block handle an event at t, and write the outputs."""
        try:
            self._write(self._block.handle_event(float(self._clock[0]), self._read()))
        except InvalidReturn as e:
            raise e.by(self._block.handle_event) from e.__cause__

    def next_event(self) -> None:
        """Write the time of the next time event, or infinity, in the place of dt."""
        event_time = self._block.next_event(float(self._clock[0]))
        try:
            self._clock[1] = math.inf if event_time is None else event_time
        except (TypeError, ValueError) as e:
            raise OtherReturn(event_time, "a time, such as t + 0.5, or None").by(self._block.next_event) from e

    def derivative(self, seed: bytes) -> bytes:
        """Return the directional derivative of the real outputs by the real inputs; float64, in the buffers' order."""
        du, to_vector = self._derive(seed)
        try:
            return to_vector(self._block.directional_derivative(float(self._clock[0]), self._read(), du))
        except InvalidReturn as e:
            raise e.by(self._block.directional_derivative) from e.__cause__

    def reset(self) -> None:
        """Restore the state of a new instance."""
        self._buffers.reset()
        self._made_from = self._before_tick = None

    def get_state(self) -> bytes:
        """Return the variables, the time, and the block's state if there is a block that fits its parameters.

        During a tentative step, that is the state before it.
        """
        parts = [self._buffers.to_bytes()]
        if self._made_from == self._buffers.parameters():
            parts.append(self._block.get_state() if self._before_tick is None else self._before_tick)
        return join(parts)

    def set_state(self, state: bytes) -> None:
        """Restore what `get_state` returned, here or in another instance.

        Raises:
            InvalidState: it is a state of another unit, or damaged; nothing is changed.
            ParameterOutOfRange, UnknownItem: a parameter in it is invalid; nothing is changed.
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
        try:
            self._block.set_state(parts[1])
        except BaseException:
            self._buffers.from_bytes(before)
            raise

    def get_string(self, index: int) -> bytes:
        """Return a string variable as UTF-8; the bytes live until the variable changes."""
        return self._buffers.strings[index]

    def set_string(self, index: int, value: bytes) -> None:
        """Set a string variable.

        Raises:
            UnicodeDecodeError: the bytes are not UTF-8.
        """
        value.decode()
        self._buffers.strings[index] = value

    def _make(self) -> None:
        """Make a block from the parameters; if that fails, the previous block and its parameters are kept."""
        block = self._type(read_parameters(self._buffers))
        fresh: object = block.get_state()
        if not isinstance(fresh, bytes):
            expected = 'bytes, such as pack_state((self.q, self.v)), or b"" without a state'
            raise OtherReturn(fresh, expected).by(block.get_state)
        self._fresh = fresh
        self._block, self._made_from = block, self._buffers.parameters()
