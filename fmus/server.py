"""Runs an FMU's Python side in a process of its own: the script that runtime/remote.c starts.

It executes the host's calls, one after another, until the host closes the channel or ends. In the interpreter that a
unit brings along, it serves all instances of the unit in one process, each in a thread (runtime/process_shared.c).
Standard library only.
"""

import ctypes
import mmap
import os
import runpy
import signal
import socket
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from types import ModuleType
from typing import Any

CALL = struct.Struct("=32sqQQ")
"""CallHead in remote.c: the method, its index or -1, the number of bytes that follow, whether they are an argument."""

ANSWER = struct.Struct("=QQ")
"""AnswerHead in remote.c: the outcome, the number of bytes that follow."""

BEGUN = struct.Struct("=QQQ")
"""Begun in remote.c: address and size of the buffers' memory, the number of bytes of a warning."""

ANSWERED, REFUSED, RAISED = 0, 1, 2
"""Outcomes, as in runtime/side.h: the method returned, rejected the call and changed nothing, or failed."""

GRACE_PERIOD = 5.0
"""Seconds that a call may take to return once the host has ended, before the process is ended."""

POLL_INTERVAL = 500
"""How often it is checked whether the host still runs, ms."""

_starting = threading.Lock()  # `runpy` works for one thread at a time


class Channel:
    """Carries bytes from and to the host: a socket, or on Windows a pipe.

    Args:
        number: of the file descriptor; on Windows of the handle.
    """

    def __init__(self, number: int) -> None:
        self._file = _descriptor(number)

    def receive(self, size: int) -> bytes:
        """Return that many bytes.

        Raises:
            SystemExit: the host has closed the channel, or has ended.
        """
        parts: list[bytes] = []
        while size > 0:
            try:
                part = os.read(self._file, min(size, 1 << 20))
            except OSError:
                part = b""
            if not part:
                raise SystemExit
            parts.append(part)
            size -= len(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def send(self, data: bytes) -> None:
        """Send all bytes.

        Raises:
            SystemExit: the host has closed the channel, or has ended.
        """
        rest = memoryview(data)
        while rest:
            try:
                rest = rest[os.write(self._file, rest) :]
            except OSError:
                raise SystemExit from None


class Server:
    """One instance's Python side: receives calls, calls the slave, sends results.

    Args:
        channel: to the host.
        memory: number of the file that is shared with the host; empty, or with what a process wrote that has ended.
    """

    def __init__(self, channel: Channel, memory: int) -> None:
        self._channel = channel
        self._file = _descriptor(memory)
        self._memory = mmap.mmap(-1, 1)
        self._explain: Callable[[BaseException], str] = _trace
        self._methods: dict[bytes, Callable[..., Any]] = {}
        self._slave: Any = None  # nothing that it or `_methods` refers to may refer to this object

    def run(self) -> None:
        """Execute calls until the host closes the channel."""
        while True:
            method, index, size, given = CALL.unpack(self._channel.receive(CALL.size))
            arguments: list[Any] = [] if index < 0 else [index]
            data = self._channel.receive(size)
            if given:
                arguments.append(data)
            outcome, answer = self._answer(method, arguments)
            self._channel.send(ANSWER.pack(outcome, len(answer)) + answer)

    def _answer(self, method: bytes, arguments: list[Any]) -> tuple[int, bytes]:
        try:
            answer = self._find(method)(*arguments)
        except BaseException as error:  # SystemExit, too, is the block's failure
            error.__traceback__ = error.__traceback__ and error.__traceback__.tb_next
            outcome = REFUSED if getattr(error, "is_refusal", False) else RAISED
            return outcome, self._explain(error).encode(errors="backslashreplace")
        return ANSWERED, answer or b""

    def _find(self, method: bytes) -> Callable[..., Any]:
        if method not in self._methods:
            name = method.rstrip(b"\0").decode()
            if name == "start":
                return self._start
            self._methods[method] = getattr(self._slave, name)
        return self._methods[method]

    def _start(self, wanted: bytes) -> bytes:
        token, _, resources = wanted.decode(errors="surrogateescape").partition("\n")
        with _starting:
            loader = runpy.run_path(
                os.path.join(resources, "sources", "handover", "fmus", "loader.py"), run_name="fmu_loader"
            )
            self._explain = loader["explain"]
            self._slave = loader["start"](resources, token, self._share)
        warning: bytes = loader["warning"](resources).encode()
        table: bytes = self._slave.table()
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        return BEGUN.pack(address, len(self._memory), len(warning)) + warning + table

    def _share(self, size: int) -> mmap.mmap:
        """Return the memory that is shared with the host; the file gets its size."""
        os.ftruncate(self._file, size)
        if hasattr(os, "posix_fallocate"):  # raises if the disk is full, where writing to the memory would crash
            os.posix_fallocate(self._file, 0, size)
        self._memory = mmap.mmap(self._file, size)
        self.close_file()  # the memory keeps it; a process that serves many instances has descriptors for few files
        return self._memory

    def close_file(self) -> None:
        """Close the descriptor of the shared memory's file, unless that is done."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(type(error), error, error.__traceback__))


def _descriptor(number: int) -> int:
    if sys.platform != "win32":
        os.set_inheritable(number, False)
        return number
    msvcrt: Any = _module("msvcrt")
    return msvcrt.open_osfhandle(number, os.O_RDWR | getattr(os, "O_BINARY", 0))


def _module(name: str) -> ModuleType:
    """Import a module that only some systems have; by name, as type checkers know it on one system only."""
    return __import__(name)


def _close_all_but(kept: tuple[int, ...]) -> None:
    """Close the descriptors that were inherited from the host: its files and sockets must not stay open here."""
    if os.path.isdir("/dev/fd"):
        for name in os.listdir("/dev/fd"):
            if int(name) not in kept:
                try:
                    os.close(int(name))
                except OSError:  # the descriptor of the listing itself, which is closed already
                    continue


def _end_with_the_host(host: int, number: int) -> None:
    """End the process when the host has closed the channel, or has ended while a fork of it keeps the channel open.

    A block that never returns must not outlive the host.
    """
    select: Any = _module("select")
    poller = select.poll()
    poller.register(number, 0)  # hang-ups are reported whatever events are asked for
    while os.getppid() in (host, 0):  # 0: the host is in another namespace of processes, and cannot be seen from here
        if any(event & (select.POLLHUP | select.POLLERR) for _, event in poller.poll(POLL_INTERVAL)):
            break
    threading.Event().wait(GRACE_PERIOD)
    os._exit(1)


def _serve_instances(control: int) -> None:
    """Serve each instance whose channel and memory come by a socket, until the host closes that or ends.

    The system drops descriptors for which there is no room, so room for two is kept. An instance that takes the last
    of it is refused, and those that run go on.
    """
    threads: list[threading.Thread] = []
    incoming = socket.socket(fileno=control)
    poller = _module("select").poll()
    poller.register(incoming, _module("select").POLLIN)
    while True:
        spare = _duplicates(control, 2)
        poller.poll()
        for number in spare:
            os.close(number)
        byte, numbers, _, _ = socket.recv_fds(incoming, 1, 2)
        if not byte:
            break
        spare = _duplicates(control, 2)
        has_room = len(numbers) == len(spare) == 2
        for number in spare:
            os.close(number)
        threads = [thread for thread in threads if thread.is_alive()]
        if has_room:
            threads.append(threading.Thread(target=_serve, args=tuple(numbers), daemon=True))
        elif numbers:
            for number in numbers[1:]:
                os.close(number)
            threads.append(threading.Thread(target=_refuse, args=(numbers[0],), daemon=True))
        else:
            continue
        threads[-1].start()
    deadline = time.monotonic() + GRACE_PERIOD
    for thread in threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    if any(thread.is_alive() for thread in threads):
        os._exit(1)


def _duplicates(number: int, count: int) -> list[int]:
    """Return duplicates of a descriptor: so many, or as many as the limit leaves room for."""
    made: list[int] = []
    try:
        while len(made) < count:
            made.append(os.dup(number))
    except OSError:
        pass
    return made


def _serve(channel: int, memory: int) -> None:
    """Serve one instance until the host closes its channel; the files are this thread's."""
    server = Server(Channel(channel), memory)
    try:
        server.run()
    except SystemExit:
        pass
    finally:
        os.close(channel)
        server.close_file()


def _refuse(channel: int) -> None:
    """Tell an instance, until the host closes its channel, that this process has no room for it."""
    reason = (
        b"the process that serves all instances of this unit is at its limit of open files, and takes no further one. "
        b"Cure: free instances, or start the host with a higher limit (ulimit -n)"
    )
    host = Channel(channel)
    try:
        while True:
            _, _, size, _ = CALL.unpack(host.receive(CALL.size))
            host.receive(size)
            host.send(ANSWER.pack(RAISED, len(reason)) + reason)
    except SystemExit:
        pass
    finally:
        os.close(channel)


def main() -> None:
    """Serve the host.

    The arguments are this script and numbers: of the host's process, then of the channel and the shared memory, or of a
    socket by which the host sends both for each instance that it makes of the unit.
    """
    host, *numbers = (int(number) for number in sys.argv[2:])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the host's to handle
    sys.argv[1:] = []
    if sys.platform != "win32":  # on Windows the host's job object ends this process
        _close_all_but((0, 1, 2, *numbers))
        threading.Thread(target=_end_with_the_host, args=(host, numbers[0]), daemon=True).start()
    if len(numbers) == 1:
        _serve_instances(numbers[0])
        return
    channel, memory = numbers
    Server(Channel(channel), memory).run()


if __name__ == "__main__":
    main()
