"""The process that serves instances: what is left of one that has ended, and its limit of open files."""

import contextlib
import gc
import os
import socket
import subprocess
import sys
import time
import weakref
import zipfile
from pathlib import Path

import pytest

import handover.fmus.server
from handover.fmus.build import cached
from handover.fmus.server import ANSWER, CALL, RAISED, Channel, Server

pytestmark = pytest.mark.skipif(os.name == "nt", reason="the channel is a pipe there")


def test_nothing_is_left_of_an_instance_that_has_ended(tmp_path: Path):
    with zipfile.ZipFile(cached("Push", 3)) as archive:
        archive.extractall(tmp_path)
        token = archive.read("resources/unit.json").decode().partition('"token": "')[2].partition('"')[0]
    start = f"{token}\n{tmp_path / 'resources'}".encode()
    host, ours = socket.socketpair()
    host.sendall(CALL.pack(b"start", -1, len(start), True) + start)
    host.sendall(CALL.pack(b"initialise", -1, 0, False))
    host.shutdown(socket.SHUT_WR)
    memory = os.open(tmp_path / "memory", os.O_RDWR | os.O_CREAT)
    server = Server(Channel(ours.fileno()), memory)
    gc.collect()
    gc.disable()
    try:
        with contextlib.suppress(SystemExit):
            server.run()
        answers = host.recv(1 << 20)
        left = [weakref.ref(server), weakref.ref(server._memory)]  # type: ignore
        del server
        assert [reference() for reference in left] == [None, None]
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(memory)
    finally:
        gc.enable()
    assert ANSWER.unpack(answers[: ANSWER.size])[0] == 0, answers
    assert answers.endswith(ANSWER.pack(0, 0))


@pytest.mark.skipif(not hasattr(socket, "send_fds"), reason="descriptors are not sent there")
def test_an_instance_beyond_the_limit_of_open_files_is_refused_and_those_before_go_on():
    control, theirs = socket.socketpair()
    begin = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='__main__')"
    arguments = [sys.executable, "-c", begin, handover.fmus.server.__file__, str(os.getpid()), str(theirs.fileno())]
    limited = ["/bin/sh", "-c", 'ulimit -n 20; exec "$@"', "sh", *arguments]
    channels: list[socket.socket] = []
    with subprocess.Popen(limited, pass_fds=(theirs.fileno(),)) as process, control:
        theirs.close()
        try:
            answers: list[bytes] = []
            while len(channels) < 20 and not any(b"limit of open files" in answer for answer in answers):
                channels.append(_hand_over(control))
                answers.append(_ask(channels[-1]))
            assert 2 < len(channels) < 20
            assert b"(ulimit -n)" in answers[-1]
            assert b"no attribute" in _ask(channels[0])
            for _ in range(2):
                channels.pop().close()  # at which the process closes its end, soon
            deadline = time.monotonic() + 5.0
            while b"no attribute" not in answers[-1] and time.monotonic() < deadline:
                with _hand_over(control) as further, contextlib.suppress(ConnectionError):  # while it is refused
                    answers.append(_ask(further))
            assert b"no attribute" in answers[-1]
            for channel in channels:
                channel.close()
            control.close()
            assert process.wait(10) == 0
        finally:
            process.kill()


def _hand_over(control: socket.socket) -> socket.socket:
    """Make an instance as the runtime does; return its channel."""
    channel, theirs = socket.socketpair()
    channel.settimeout(10)
    memory = os.memfd_create("memory") if sys.platform == "linux" else os.open(os.devnull, os.O_RDWR)
    socket.send_fds(control, [b"\0"], [theirs.fileno(), memory])
    theirs.close()
    os.close(memory)
    return channel


def _ask(channel: socket.socket) -> bytes:
    """Call a method that no instance has before it is started; return why it fails."""
    channel.sendall(CALL.pack(b"step", -1, 0, False))
    head = channel.recv(ANSWER.size, socket.MSG_WAITALL)
    outcome, size = ANSWER.unpack(head)
    assert outcome == RAISED
    return channel.recv(size, socket.MSG_WAITALL)
